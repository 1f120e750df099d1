/* Included first in files whose operations may be contracted: the compiler forms fused operations, whatever its flags say
   of other files. EOMGEN_CONTRACTS: it does, where the processor has them; gcc forms none without this optimisation. */
#ifndef EOMGEN_CONTRACTION_H
#define EOMGEN_CONTRACTION_H

#if defined(__clang__)
#pragma STDC FP_CONTRACT ON
#pragma clang fp contract(fast)
#define EOMGEN_CONTRACTS
#elif defined(__GNUC__) && defined(__OPTIMIZE__)
#pragma GCC optimize("O2", "fp-contract=fast")
#define EOMGEN_CONTRACTS
#endif

#endif
