/* Two-stage SDIRK of order 2, L-stable, for models that are linear in x:
       (1 - g h A) k1 = f(x),   (1 - g h A) k2 = f(x + (1 - g) h k1),   x += h ((1 - g) k1 + g k2)
   with g = 1 - 1/sqrt(2). One sparse LU without pivoting serves both stages and every step until a
   parameter or h changes. Its pattern (PERM, ROW, COL, DIAG, MROW, MCOL): rows in order of elimination,
   each with its columns ascending; MROW and MCOL hold the matrix itself. */
#define KEY OWN
#define LU (KEY + 1 + U)
#define INV (LU + NLU)
#define K1 (INV + NX)
#define K2 (K1 + NX)
#define T (K2 + NX)
#define V (T + NX)
#define IMPLICIT_SIZE (V + NX - OWN)
static const double G = 0.29289321881345254;

static void factorise(const double *z, double gh, double *w) {
    double m[NM + 1], *lu = w + LU, *inv = w + INV, *row = w + V;
    matrix(z, gh, m, w);
    for (int i = 0; i < NX; ++i) {
        for (int q = ROW[i]; q < ROW[i + 1]; ++q) row[COL[q]] = 0;
        for (int q = MROW[i]; q < MROW[i + 1]; ++q) row[MCOL[q]] = m[q];
        for (int q = ROW[i]; q < DIAG[i]; ++q) {
            const int c = COL[q];
            const double l = row[c] * inv[c];
            row[c] = l;
            for (int r = DIAG[c] + 1; r < ROW[c + 1]; ++r) row[COL[r]] -= l * lu[r];
        }
        for (int q = ROW[i]; q < ROW[i + 1]; ++q) lu[q] = row[COL[q]];
        inv[i] = 1 / row[i];
    }
}

static void solve(const double *b, double *k, double *w) {
    const double *lu = w + LU, *inv = w + INV;
    double *v = w + V;
    for (int i = 0; i < NX; ++i) {
        double s = b[PERM[i]];
        for (int q = ROW[i]; q < DIAG[i]; ++q) s -= lu[q] * v[COL[q]];
        v[i] = s;
    }
    for (int i = NX - 1; i >= 0; --i) {
        double s = v[i];
        for (int q = DIAG[i] + 1; q < ROW[i + 1]; ++q) s -= lu[q] * v[COL[q]];
        v[i] = s * inv[i];
        k[PERM[i]] = v[i];
    }
}

KERNEL int advance(double *z, double h, int n, double *w) {
    double *x = z + X, *k1 = w + K1, *k2 = w + K2, *t = w + T;
    enter(z, w);
    if (w[KEY] != h || memcmp(w + KEY + 1, z, U * sizeof(double))) {
        factorise(z, G * h, w);
        w[KEY] = h;
        memcpy(w + KEY + 1, z, U * sizeof(double));
    }
    for (int step = 0; step < n; ++step) {
        rates(z, x, t, w);
        solve(t, k1, w);
        for (int i = 0; i < NX; ++i) k2[i] = x[i] + (1 - G) * h * k1[i];
        rates(z, k2, t, w);
        solve(t, k2, w);
        for (int i = 0; i < NX; ++i) x[i] += h * ((1 - G) * k1[i] + G * k2[i]);
    }
    return finish(z, w);
}
