/* Classical Runge-Kutta of order 4; it keeps nothing of its own. The NS stepwise states (indices STEPWISE) are held until
   the end of the communication step and then move by their rate at its beginning. */
static void held_rates(const double *z, const double *x, double *rate, double *w) {
    rates(z, x, rate, w);
    for (int i = 0; i < NS; ++i) rate[STEPWISE[i]] = 0;
}

KERNEL int advance(double *z, double h, int n, double *w) {
    double k1[NX + 1], k2[NX + 1], k3[NX + 1], k4[NX + 1], t[NX + 1], *x = z + X, moved[NS + 1];
    enter(z, w);
    if (NS) {
        rates(z, x, k1, w);
        for (int i = 0; i < NS; ++i) moved[i] = n * h * k1[STEPWISE[i]];
    }
    for (int step = 0; step < n; ++step) {
        held_rates(z, x, k1, w);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k1[i];
        held_rates(z, t, k2, w);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h / 2 * k2[i];
        held_rates(z, t, k3, w);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + h * k3[i];
        held_rates(z, t, k4, w);
        for (int i = 0; i < NX; ++i) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
    for (int i = 0; i < NS; ++i) x[STEPWISE[i]] += moved[i];
    return finish(z, w);
}
