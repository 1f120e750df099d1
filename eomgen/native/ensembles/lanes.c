/* Trajectories LANES at a time; for 4 and 8 on processors with AVX2 and AVX512F. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "eomgen_ensembles.h"

#if EOMGEN_LANES & LANES
#define EOMGEN_CONTRACT
#include "eomgen_calls.h"
#if LANES == 4 && defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#elif LANES == 4
#pragma GCC target("avx2,fma")
#elif LANES == 8 && defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx512f,avx512vl,avx512dq,fma"))), apply_to = function)
#elif LANES == 8
#pragma GCC target("avx512f,avx512vl,avx512dq,fma")
#endif
#define EOMGEN_WIDTH LANES
#include "eomgen_lane_runs.h"

#define NAME_(width) eomgen_lane_worker##width
#define NAME(width) NAME_(width)
EOMGEN_PIECE extern const eomgen_lane_worker NAME(LANES);
const eomgen_lane_worker NAME(LANES) = { LANES, lane_memory, takes, work_in_lanes };
#if LANES > 2 && defined(__clang__)
#pragma clang attribute pop
#endif
#else
typedef int no_lanes;
#endif
