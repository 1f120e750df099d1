/* Trajectories 4 at a time, on processors with AVX2. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "eomgen_ensembles.h"

#if EOMGEN_LANES & 4
#define EOMGEN_CONTRACT
#include "eomgen_processor.h"
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC target("avx2,fma")
#endif
#define EOMGEN_WIDTH 4
#include "eomgen_lane_runs.h"

EOMGEN_PIECE extern const eomgen_lane_worker eomgen_lane_worker4;
const eomgen_lane_worker eomgen_lane_worker4 = { 4, lane_memory, takes, work_in_lanes };
#if defined(__clang__)
#pragma clang attribute pop
#endif
#else
typedef int no_lanes_of_4;
#endif
