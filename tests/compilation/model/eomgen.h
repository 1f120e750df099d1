/* The C table of a model, layout 1. */
#ifndef EOMGEN_H
#define EOMGEN_H

typedef int (*eomgen_function)(double, const double *, const double *, const double *, double *, double *);

typedef struct {
    const char *name;
    eomgen_function call;
    int n_in;
    int n_out;
} eomgen_kernel;

typedef struct {
    int abi;
    const char *name;
    int n_p, n_u, n_const, n_work, n_kernels;
    const eomgen_kernel *kernels;
    int (*precompute)(const double *, double *);
    const char *metadata;
} eomgen_model;

const eomgen_model *eomgen_model_table(void);

#endif
