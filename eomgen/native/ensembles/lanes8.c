/* Trajectories 8 at a time, on processors with AVX512F. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "eomgen_ensembles.h"

#if EOMGEN_LANES & 8
#define EOMGEN_CONTRACT
#include "eomgen_processor.h"
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx512f,avx512vl,avx512dq,fma"))), apply_to = function)
#else
#pragma GCC target("avx512f,avx512vl,avx512dq,fma")
#endif
#define EOMGEN_WIDTH 8
#include "eomgen_lane_runs.h"

EOMGEN_PIECE extern const eomgen_lane_worker eomgen_lane_worker8;
const eomgen_lane_worker eomgen_lane_worker8 = { 8, lane_memory, takes, work_in_lanes };
#if defined(__clang__)
#pragma clang attribute pop
#endif
#else
typedef int no_lanes_of_8;
#endif
