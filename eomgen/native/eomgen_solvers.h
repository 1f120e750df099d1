/* Solvers of equations of motion, the same for all models. A model's own C is straight-line functions and the table
   eom_model; what iterates or chooses pivots is here, with sizes known at run time, without heap or globals, in the
   work memory of the caller. */
#ifndef EOMGEN_SOLVERS_H
#define EOMGEN_SOLVERS_H

#include "eomgen.h"
#include "eomgen_real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Areas of the work memory, behind what straight-line functions use, in the order of eom_model.areas. n: velocities,
   nq: coordinates, m: rows of constraints, mh: holonomic ones among them, f: degrees of freedom. */
enum {
    AREA_X,           /* q, v, a, multipliers, dq, dv; changes of inputs or parameters, or loads, where dq begins */
    AREA_SCALES,      /* units of the n velocities and m rows */
    AREA_TERMS,       /* M packed row by row, its lower triangle; h (n), C_q (m n), gamma (m) */
    AREA_RESIDUAL,    /* derivatives of residuals: r1 by q and v, r2 by q and v, r3 by q */
    AREA_ALONG,       /* r1, r2, r3 along a direction */
    AREA_RATES,       /* q' */
    AREA_SHIFT,       /* C, r1, r2, r3 along a change of an input or a parameter */
    AREA_FULL,        /* M (n n) */
    AREA_UNIT,        /* q, a, M a */
    AREA_DIAGONAL,    /* sizes of diagonal entries (n) */
    AREA_MARKS,       /* whether a coordinate or velocity is done (nq + n) */
    AREA_GRADIENT,    /* dC/dq (mh nq) */
    AREA_NORMAL,      /* its products (m m) */
    AREA_MENDED,      /* a change of q, then residuals (m), velocities (n) */
    AREA_POSITION,    /* C (mh), C_q (m n) */
    AREA_RATE,        /* C_t, or what a correction has to cancel (m) */
    AREA_J,           /* scaled C_q (m n) */
    AREA_G,           /* factor of J J^T (m m) */
    AREA_GH,          /* the same of the holonomic rows */
    AREA_E,           /* residuals and their combination (2 m) */
    AREA_NOISE,       /* what rounding makes of each row (m) */
    AREA_STEP,        /* a step of Newton's method (n) */
    AREA_ROWS,        /* rows that are eliminated (m (n + 1 + m)) */
    AREA_PARTITION,   /* smallest pivot, dependent, their rows, independent (1 + 3 n) */
    AREA_PIVOTING,    /* of rows: used, best columns, changed, size, size of groups; of columns: taken (6 m + 1 + n) */
    AREA_B,           /* velocities of independent velocities (n f) */
    AREA_MASS,        /* scaled M (n n) */
    AREA_MB,          /* M B (n f) */
    AREA_EMBEDDED,    /* B^T M B (f f) */
    AREA_H,           /* scaled h (n) */
    AREA_A,           /* scaled a (n) */
    AREA_Y,           /* accelerations of independent velocities (f) */
    AREA_STATE,       /* near a singular position: q, v in the middle */
    AREA_NEXT,        /* q, v, x' at a point of the curve */
    AREA_TANGENT,     /* basis T of its tangents (n f) */
    AREA_INVERSE,     /* (T^T T)^-1 T^T behind what is eliminated (f (f + n)) */
    AREA_HEADING,     /* coordinates of the direction, defects of a point (2 f) */
    AREA_DIRECTION,   /* scaled direction (n) */
    AREA_AWAY,        /* from the middle: coordinates, velocities */
    AREA_POINTS,      /* 10 points (nq) */
    AREA_SUMS,        /* interpolations of [q v x'] by 2 to 5 pairs of points */
    AREA_BEST,        /* the best of them */
    AREA_KEPT,        /* q, v */
    AREA_RATED,       /* x' */
    AREA_TURN,        /* a Jacobian */
    AREA_CLOSING,     /* result of `closing`: mean residual, what linear theory leaves of it, length, step (n) */
    AREA_DYNAMICS,    /* result of `dynamics`: v, a, whether they are sound, whether no singular position is near */
    AREA_SYSTEM,      /* entries of K, right side, sizes of equations and of unknowns */
    AREA_LU,          /* factors of K */
    AREA_ROW,         /* scales of equations */
    AREA_COLUMN,      /* and of unknowns */
    AREA_DEFECT,      /* defects, sizes of terms */
    AREA_PLAN,        /* rows exchanged, last column of each row of U, last row of each column of L */
    AREA_MOTION,      /* q, v, unknowns */
    AREA_DAE,         /* y, y', dy, dy' */
    AREA_SLOPE,       /* dF */
    AREA_SLOPES,      /* result of `loop_slopes`: v, whether it is sound, whether no singular position is near */
    AREA_COEFFICIENTS, /* of derivatives along a direction; this area and the next three follow each other */
    AREA_TURNING,     /* a direction of q or of v */
    AREA_MET,         /* numbers of near pairs, 0 before they are looked for */
    AREA_SHAPES,      /* these pairs */
    AREA_CHANGE,      /* of q' and v' */
    AREA_SPAN,        /* such changes along independent directions */
    AREA_SHARES,      /* of independent velocities in these (f f) */
    AREA_CONTACT_OPERANDS, /* of contacts with states: operands, numbers of pairs, list of pairs, work */
    AREA_CONTACT_GIVEN,
    AREA_CONTACT_LIST,
    AREA_CONTACT_WORK,
    AREA_TORQUES,     /* q, v, a, dq, dv, da; d(M a + h) */
    AREAS
};

/* States of contacts whose columns of a Jacobian follow from the pairs in contact: those seeded at a time (start,
   state), the states whose rates depend on each (first, row), and what near pairs of one sum exert by their states.
   */
typedef struct {
    int groups, sums, loads;
    const int *start, *state, *first, *row;
    const int *(*pairs)(int sum, const double *x, const double *operands, double *numbers, double *list, double *work,
        int *load);
} eom_contacts;

struct eom_at;

typedef struct {
    int n_v, n_q, n_c, n_h;         /* velocities, coordinates, rows of constraints, the holonomic ones, which are first */
    int rank, n_dof;                /* of the rows; degrees of freedom */
    int n_u, n_p;                   /* inputs, parameters */
    int n_moving;                   /* velocities before first-order states */
    int indefinite;                 /* whether inertias that no body can have are allowed: pivots may be negative */
    int projects;                   /* whether states are brought onto the constraints */
    int singular;                   /* whether the motion is followed through singular positions, */
    int project_singular;           /* by `project` too */
    int outputs_accelerate;         /* whether outputs depend on accelerations */
    int n_quaternions;
    int n_unknowns, n_places, n_relaxed; /* of the linear system of the accelerations */
    const int *order;               /* velocities preferred as independent, in their order, then the others */
    const int *preferred_dependent; /* whether a velocity is one of the others */
    const int *row_group;           /* rows compared with each other: 1, 2, ... components of a gap, -1 with 1, 0 with all */
    const int *row_start, *row_velocity; /* where the velocities begin that each row knows, and these */
    const int *parent;              /* the next velocity towards ground, -1 at ground */
    const int *coordinate;          /* whose rate a velocity is; -1: an angular velocity of Euler parameters, or a state */
    const int (*quaternion)[2];     /* first Euler parameter in q and first component of the angular velocity in v */
    const short (*place)[2];        /* entries of the system by row and column, */
    const short (*relax)[2];        /* and those that are relaxed */
    const eom_contacts *contacts;
    int areas[AREAS];
    /* close_directly (eomgen_straight.h) with fixed sizes and `closing`, `short_closing` as parts of it, or NULL. */
    int (*close)(const struct eom_at *at, double *q, double *w, int *shorter);
    /* Straight-line functions; NULL where the model has none. */
    eomgen_function scales;
    eomgen_function position;       /* q -> C, C_q */
    eomgen_function rate;           /* q -> C_t */
    eomgen_function rates;          /* q' = N v + b, where no coordinate's rate is a velocity, */
    eomgen_function moved;          /* N d, */
    eomgen_function rates_along;    /* dq' along (dq, dv), */
    eomgen_function coordinate_slopes; /* dC/dq */
    eomgen_function terms;          /* M packed, h, C_q, gamma; or composed of: */
    eomgen_function mass_matrix;
    eomgen_function mass_times;     /* q, a -> M a */
    eomgen_function bias;
    eomgen_function constraint_jacobian;
    eomgen_function gamma;
    eomgen_function closing;        /* a Newton step onto the constraints, */
    eomgen_function dynamics;       /* velocities and accelerations at a closed position, */
    eomgen_function short_closing; /* both in a shorter form that is tried first */
    eomgen_function short_dynamics;
    eomgen_function system;         /* the linear system K z = r of the accelerations */
    eomgen_function joint_accelerations; /* q, v, z -> v' */
    eomgen_function accelerated_outputs;
    eomgen_function residual_jacobian; /* derivatives of the residuals, written out */
    eomgen_function residual_tangent; /* or along a direction */
    eomgen_function input_shift;    /* C and residuals along changes of inputs, */
    eomgen_function parameter_shift; /* of parameters */
    eomgen_function acceleration_tangent; /* v' along changes of the state, */
    eomgen_function input_acceleration; /* of inputs, */
    eomgen_function parameter_acceleration; /* of parameters */
    eomgen_function dae_tangent;    /* F(y, y') along (dy, dy') */
    eomgen_function inverse_tangent; /* M a + h along (dq, dv, da) */
    eomgen_function loop_slopes;    /* coefficients of the derivatives of x' by bodies, */
    eomgen_function slopes_by_position; /* and these along dq, */
    eomgen_function slopes_by_velocity; /* along dv */
    eomgen_function contact_terms;     /* of contacts with states: M and h without them, */
    eomgen_function contact_operands;  /* operands of their sums, */
    eomgen_function contact_loads;     /* generalized forces of loads on bodies */
} eom_model;

/* Where a function is evaluated: time, inputs, constants made by precompute; w: n_work doubles of work. */
typedef struct eom_at {
    const eom_model *m;
    double t;
    const double *u, *c;
    double *w;
} eom_at;

/* Public functions that are no straight-line code; x and out as in the model's header. */
typedef int (*eom_solver)(const eom_at *at, const double *x, double *out);
#define EOM_EACH(X) \
    X(project) X(rhs) X(outputs) X(jacobian) X(input_jacobian) X(parameter_jacobian) X(mass_matrix) X(embedded_mass_matrix) \
    X(kinematics) X(dae_jacobian) X(inverse_dynamics_derivatives)

/* The same as a table: models that a session opens are compiled without the solvers and take those of eomgen._native,
   where both have the same layout. finish_rhs: x' where the straight-line right-hand side is not enough
   (eomgen_straight.h); sound: whether it has been evaluated and holds, next to a singular position perhaps. */
#define EOM_ENTRY(name) eom_solver name;
typedef struct {
    int layout;
    EOM_EACH(EOM_ENTRY)
    int (*finish_rhs)(const eom_at *at, const double *x, double *out, int sound);
} eom_solvers;
enum { EOM_LAYOUT = (int)sizeof(eom_model) };
#ifdef EOMGEN_OPENED
EOMGEN_PIECE extern const eom_solvers *eom_library;
#define EOM_SOLVER(name) \
    static inline int eom_##name(const eom_at *at, const double *x, double *out) { return eom_library->name(at, x, out); }
#define eom_finish_rhs eom_library->finish_rhs
#else
#define EOM_SOLVER(name) EOMGEN_PIECE int eom_##name(const eom_at *at, const double *x, double *out);
EOMGEN_PIECE int eom_finish_rhs(const eom_at *at, const double *x, double *out, int sound);
#endif
EOM_EACH(EOM_SOLVER)

#ifdef __cplusplus
}
#endif

#endif
