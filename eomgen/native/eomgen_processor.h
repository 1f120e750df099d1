/* What processors can do: operations that may be contracted, and what instructions there are. */
#ifndef EOMGEN_PROCESSOR_H
#define EOMGEN_PROCESSOR_H

/* EOMGEN_CONTRACT: of a file whose operations may be contracted, which includes this first: the compiler forms fused
   operations, whatever its flags say of other files. EOMGEN_CONTRACTS: it does, where the processor has them; gcc forms
   none without this optimisation. */
#if defined(EOMGEN_CONTRACT) && defined(__clang__)
#pragma STDC FP_CONTRACT ON
#pragma clang fp contract(fast)
#define EOMGEN_CONTRACTS
#elif defined(EOMGEN_CONTRACT) && defined(__GNUC__) && defined(__OPTIMIZE__)
#pragma GCC optimize("O2", "fp-contract=fast")
#define EOMGEN_CONTRACTS
#endif

#if defined(__x86_64__) && !defined(EOMGEN_CONTRACT)
#include <cpuid.h>

/* What instructions this x86-64 processor, and the system for its registers, has; the compilers' own test for that is not
   in every runtime library. */
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
#endif
