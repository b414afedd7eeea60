/* Classical Runge-Kutta of order 4; no workspace. The NS stepwise states (indices STEPWISE, generated above) are held
   until the end of the communication step and then move by their rate at its beginning. */
KERNEL int workspace_size(void) { return 0; }

static void hold(double *rate) {
    for (int i = 0; i < NS; ++i) rate[STEPWISE[i]] = 0;
}

KERNEL int advance(double *z, double h, int n, double *workspace) {
    (void)workspace;
    double k1[NX], k2[NX], k3[NX], k4[NX], t[NX], *x = z + X, moved[NS + 1];
    if (NS) {
        rates(z, x, k1);
        for (int i = 0; i < NS; ++i) moved[i] = n * h * k1[STEPWISE[i]];
    }
    for (int step = 0; step < n; ++step) {
        rates(z, x, k1);
        hold(k1);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k1[i];
        rates(z, t, k2);
        hold(k2);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k2[i];
        rates(z, t, k3);
        hold(k3);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h * k3[i];
        rates(z, t, k4);
        hold(k4);
        for (int i = 0; i < NX; ++i) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
    for (int i = 0; i < NS; ++i) x[STEPWISE[i]] += moved[i];
    return finish(z);
}
