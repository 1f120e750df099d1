/* q' = N(q, t) v + b(q, t) as it is given, from blocks; the macros give them the t, u, c and w that all drivers have. */
#define form_rates(q, v, rates) ((void)(v), (void)rates_block(t, q, u, c, rates, w))

/* The coordinate whose rate is velocity k: none is measured. */
#define coordinate_of(q, k) ((void)(q), (void)(k), 0.0)

/* The change of q' where q and v change by w + AT_DQ and w + AT_DV, at the state in w + AT_X. */
#define change_rates(x, dq, dv, change) \
    ((void)(x), (void)(dq), (void)(dv), (void)rates_along_block(t, w + AT_X, u, c, change, w))
