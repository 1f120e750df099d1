/* The nearest x with J x + r = 0, of derivatives by some coordinate, input or parameter. */
static int correct_change(int rows, double *restrict G, const double *restrict r, double *restrict x, double *restrict w)
{
    double noise[M + 1];
    for (int i = 0; i < rows; i++) {
        noise[i] = CONSTRAINTS_EXACT * fmax(longest_of(x, N), longest_of(r, rows));
    }
    return correct_linear(rows, G, r, x, noise, 1, w);
}
