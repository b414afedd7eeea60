/* Classical Runge-Kutta of order 4; no workspace. */
KERNEL int workspace_size(void) { return 0; }

KERNEL int advance(double *z, double h, int n, double *workspace) {
    (void)workspace;
    double k1[NX], k2[NX], k3[NX], k4[NX], t[NX], *x = z + X;
    for (int step = 0; step < n; ++step) {
        rates(z, x, k1);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k1[i];
        rates(z, t, k2);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k2[i];
        rates(z, t, k3);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h * k3[i];
        rates(z, t, k4);
        for (int i = 0; i < NX; ++i) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
    return finish(z);
}
