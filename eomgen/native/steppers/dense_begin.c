/* Loops over rows of matrices, until dense_end.c, are worth more of gcc's work than the rest of this file. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__)
#pragma GCC push_options
#pragma GCC optimize("O2", "tree-vectorize")
#endif
