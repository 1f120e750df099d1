/* The nearest x with J x + r = 0, of derivatives by some coordinate, input or parameter. */
static int correct_change(int rows, double *restrict G, const double *restrict r, double *restrict x, double *restrict w)
{
    return correct_linear(rows, G, r, x, CONSTRAINTS_EXACT * fmax(longest_of(x, N), longest_of(r, rows)), 1, w);
}
