/* Trajectories 2 at a time. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "eomgen_ensembles.h"

#if EOMGEN_LANES & 2
#define EOMGEN_CONTRACT
#include "eomgen_processor.h"
#define EOMGEN_WIDTH 2
#include "eomgen_lane_runs.h"

EOMGEN_PIECE extern const eomgen_lane_worker eomgen_lane_worker2;
const eomgen_lane_worker eomgen_lane_worker2 = { 2, lane_memory, takes, work_in_lanes };
#else
typedef int no_lanes_of_2;
#endif
