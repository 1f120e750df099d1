/* The model-independent part of every generated module: the table that describes its functions. */
#ifndef EOMGEN_H
#define EOMGEN_H

#ifdef __cplusplus
extern "C" {
#endif

#define EOMGEN_ABI 5

#if defined(__clang__)
#define EOMGEN_COMPILER "clang " __clang_version__
#elif defined(__GNUC__)
#define EOMGEN_COMPILER "gcc " __VERSION__
#else
#define EOMGEN_COMPILER "unknown"
#endif

/* Status of every function: 0 is success, positive codes are recoverable (a smaller step may succeed), negative ones are
   not. */
enum {
    EOMGEN_BAD_ARGUMENT = -1,        /* outside what is allowed; nothing was written */
    EOMGEN_SUCCESS = 0,
    EOMGEN_NON_FINITE = 1,           /* a result is NaN or infinite */
    EOMGEN_SINGULAR_MASS_MATRIX = 2, /* a motion has no inertia behind it */
    EOMGEN_PROJECTION_FAILED = 3,    /* the state could not be brought onto the constraints */
    EOMGEN_PARTITION_BAD = 4,        /* the independent coordinates cannot move the mechanism here */
    EOMGEN_UNSOLVED = 5,             /* rounding leaves the linear system of the accelerations unsolved */
    EOMGEN_LEFT_ALONE = 6            /* of a lane: call the function of one state for it */
};

/* t: time; x: the inputs one after the other; u: inputs over time; c: constants made by precompute;
   out: the result (NULL: not wanted); w: n_work doubles of work. No argument may overlap another. */
typedef int (*eomgen_function)(double t, const double *x, const double *u, const double *c, double *out, double *w);

typedef struct {
    const char *name;
    eomgen_function call;
    int n_in;  /* length of x */
    int n_out; /* length of out */
} eomgen_kernel;

/* The same for several states at a time, number k of each in lane k: all arrays hold `width` doubles for every one of
   eomgen_function's, side by side, and begin at a multiple of their 8*width bytes; c too may differ from lane to lane.
   status: the status of every lane; what a lane with another than 0 has in out means nothing, but for finite entries
   with EOMGEN_NON_FINITE; the others are not affected. Returns 0 if all are 0. A lane's results have the same bits whatever the
   others hold. The right-hand side of closed loops leaves lanes that need pivoting, or many Newton steps, to the function
   of one state: EOMGEN_LEFT_ALONE. */
typedef int (*eomgen_lane_function)(const double *t, const double *x, const double *u, const double *c, double *out,
    double *w, int *status);

/* Taylor coefficients of the motion through x at t: row m of out, n_x doubles, is the derivative of order m over m!, for
   m = 0 .. order. Returns a status, as above; EOMGEN_BAD_ARGUMENT for an order below 0 or above `most`. */
typedef struct {
    int most;   /* the highest order */
    int n_work; /* length of w, all of it finite: zero at first, and after a failure or an overflow */
    int (*expand)(double t, const double *x, const double *u, const double *c, int order, double *out, double *w);
} eomgen_series;

typedef struct {
    int width;                           /* states at a time */
    int (*usable)(void);                 /* whether this processor has the instructions */
    const eomgen_lane_function *kernels; /* in the order of the model's kernels; NULL where one has no lanes */
    const eomgen_series *series;         /* of one state, where it is in the lanes' library; else NULL */
    void (*contracted)(void);            /* rhs for ensembles, a*b + c rounded once; cast to lane_function of the layer */
    void (*expand)(void);                /* the series, likewise; cast to lane_series of the layer; or NULL */
} eomgen_lanes;

typedef struct {
    int abi;
    const char *name;
    int n_p;     /* parameters */
    int n_u;     /* inputs */
    int n_const; /* length of c */
    int n_work;  /* length of w */
    int n_kernels;
    const eomgen_kernel *kernels;
    int (*precompute)(const double *p, double *c);
    const char *const *metadata; /* JSON: names, units, values; one text in pieces, then NULL */
    const eomgen_lanes *const *lanes; /* what was compiled, widest first, then NULL */
    int closed_at;        /* where in w a call of rhs leaves its state brought onto the constraints, 0 where it does not */
    const eomgen_series *series; /* NULL: not here */
    const char *compiler; /* that made this */
} eomgen_model;

/* The table of the model in this library (left out where EOMGEN_NO_TABLE is defined, to link several models); by EOMGEN_OPENED
   the one symbol that a library for dlopen shows. */
#if defined(EOMGEN_OPENED) && defined(__GNUC__)
__attribute__((visibility("default")))
#endif
const eomgen_model *eomgen_model_table(void);

#ifdef __cplusplus
}
#endif

/* Widths to compile, added up: 2 for any processor, 4 and 8 for those with AVX2 and AVX-512. */
#ifndef EOMGEN_LANES
#if !defined(__GNUC__) || defined(EOMGEN_PORTABLE)
#define EOMGEN_LANES 0
#elif defined(__x86_64__)
#define EOMGEN_LANES 14
#else
#define EOMGEN_LANES 2
#endif
#endif

/* ROWS: a function whose inner loops go along rows of numbers, several at a time where the processor can; no sum is taken
   in another order, and nothing is contracted, so that the bits stay the same. Without lanes it is compiled for one processor, but in a
   session, whose lanes lie in a library of their own. */
#if (EOMGEN_LANES || defined(EOMGEN_OPENED)) && defined(__gnu_linux__) && defined(__x86_64__) && defined(__GNUC__) \
    && !defined(__clang__) && !defined(EOMGEN_PORTABLE)
#define EOMGEN_ROWS __attribute__((optimize("O3"), target_clones("avx2", "default")))
#else
#define EOMGEN_ROWS
#endif

/* APART keeps pieces of very long code apart, so that compile time stays proportional to its length;
   PIECE marks a piece that lies in another file of the same library; SHARED a helper that not every model uses. */
#if defined(__CUDACC__)
#define EOMGEN_APART __noinline__
#define EOMGEN_PIECE __noinline__ /* all in one file */
#define EOMGEN_SHARED static __attribute__((unused))
#elif defined(__GNUC__)
#define EOMGEN_APART __attribute__((noinline))
#define EOMGEN_PIECE __attribute__((visibility("hidden")))
#define EOMGEN_SHARED static __attribute__((unused))
#else
#define EOMGEN_APART
#define EOMGEN_PIECE
#define EOMGEN_SHARED static
#endif

#endif
