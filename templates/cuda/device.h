/* What the C text of a model needs where it is compiled for a device. NVRTC has none of the headers of C, but the functions
   of math.h and string.h without them. Every thread has a state, or a run, of its own. */
#define EOMGEN_PORTABLE       /* no vector types */
#define EOMGEN_DEVICE          /* nobody is called back, no expressions come at run time */
#define EOMGEN_WITHOUT_TABLES
#ifdef __CUDACC_RTC__
typedef long long int64_t;
typedef unsigned long long uint64_t;
#define NULL 0
#define NAN __longlong_as_double(0x7ff8000000000000LL)
#define HUGE_VAL __longlong_as_double(0x7ff0000000000000LL)
#define DBL_EPSILON 2.220446049250313e-16
#else
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#endif
#ifdef __CUDACC__
#define EOMGEN_KERNEL extern "C" __global__
#define EOMGEN_OWN ((long long)blockIdx.x * blockDim.x + threadIdx.x) /* which state is this thread's */
#endif
