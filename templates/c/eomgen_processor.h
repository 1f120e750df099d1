/* What instructions this x86-64 processor, and the system for its registers, has; the compilers' own test for that is
   not in every runtime library. */
#ifndef EOMGEN_PROCESSOR_H
#define EOMGEN_PROCESSOR_H

#include <cpuid.h>

enum { EOMGEN_AVX2 = 1 /* and FMA */, EOMGEN_AVX512 = 2 /* with its extensions DQ and VL */ };

static inline int eomgen_processor(void)
{
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & (1u << 27 | 1u << 12)) != (1u << 27 | 1u << 12)) {
        return 0;
    }
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 0x06u) != 0x06u || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & 1u << 5)) {
        return 0;
    }
    const unsigned wanted = 1u << 16 | 1u << 17 | 1u << 31;
    return (low & 0xe6u) == 0xe6u && (b & wanted) == wanted ? EOMGEN_AVX2 | EOMGEN_AVX512 : EOMGEN_AVX2;
}

#endif
