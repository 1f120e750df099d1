/* Gauss-Jordan elimination of row `row` by column `column`. */
static void eliminate(double *restrict a, int width, int row, int column)
{
    const double pivot = a[row * width + column];
    for (int k = 0; k < width; k++) {
        a[row * width + k] /= pivot;
    }
    for (int i = 0; i < M; i++) {
        const double factor = a[i * width + column];
        if (i == row || factor == 0.0) {
            continue;
        }
        for (int k = 0; k < width; k++) {
            a[i * width + k] -= factor * a[row * width + k];
        }
    }
}
