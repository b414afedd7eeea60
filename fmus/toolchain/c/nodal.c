/* Voltages v of a network from Y v = i, for models whose derivatives and outputs are given at known voltages: a sparse
   complex LU without pivoting. Its pattern (PERM, ROW, COL, DIAG, MROW, MCOL) is generated above: rows in order of
   elimination, each with its columns ascending; MROW and MCOL hold the matrix itself. Y follows from parameters and
   from the inputs GIVEN; its factors are kept until one of these changes, by whatever instance. Only one thread at a
   time comes here: Python holds its lock while a kernel works. LARGEST_REST is generated above, too. */
#include <math.h>
#include <string.h>

static struct {
    int there;
    double parameters[NP + NC], inputs[NG + 1], lu[2 * NLU], inverse[2 * NB];
} factors;

/* What Y follows from is as it was when it was factorised. */
static int unchanged(const double *u, const double *p, const double *c) {
    if (!factors.there || memcmp(factors.parameters, p, NP * sizeof *p)) return 0;
    if (memcmp(factors.parameters + NP, c, NC * sizeof *c)) return 0;
    for (int k = 0; k < NG; ++k)
        if (memcmp(factors.inputs + k, u + GIVEN[k], sizeof *u)) return 0;
    return 1;
}

/* s, in the order of elimination, from b by bus: real parts, then imaginary parts. */
static void through_factors(const double *b, double *s) {
    const double *lu = factors.lu, *inverse = factors.inverse;
    for (int i = 0; i < NB; ++i) {
        double re = b[PERM[i]], im = b[NB + PERM[i]];
        for (int q = ROW[i]; q < DIAG[i]; ++q) {
            re -= lu[2 * q] * s[2 * COL[q]] - lu[2 * q + 1] * s[2 * COL[q] + 1];
            im -= lu[2 * q] * s[2 * COL[q] + 1] + lu[2 * q + 1] * s[2 * COL[q]];
        }
        s[2 * i] = re;
        s[2 * i + 1] = im;
    }
    for (int i = NB - 1; i >= 0; --i) {
        double re = s[2 * i], im = s[2 * i + 1];
        for (int q = DIAG[i] + 1; q < ROW[i + 1]; ++q) {
            re -= lu[2 * q] * s[2 * COL[q]] - lu[2 * q + 1] * s[2 * COL[q] + 1];
            im -= lu[2 * q] * s[2 * COL[q] + 1] + lu[2 * q + 1] * s[2 * COL[q]];
        }
        s[2 * i] = re * inverse[2 * i] - im * inverse[2 * i + 1];
        s[2 * i + 1] = re * inverse[2 * i + 1] + im * inverse[2 * i];
    }
}

/* Whether a trial solution leaves hardly anything over. A network that is not passive may need pivoting. The currents
   follow no pattern that the network could have as well. */
static int accurate(const double *m) {
    static double b[2 * NB], s[2 * NB];
    for (int i = 0; i < NB; ++i) {
        b[i] = cos(i);
        b[NB + i] = sin(i);
    }
    through_factors(b, s);
    for (int i = 0; i < NB; ++i) {
        double re = -b[PERM[i]], im = -b[NB + PERM[i]], size = fabs(re) + fabs(im);
        for (int q = MROW[i]; q < MROW[i + 1]; ++q) {
            const double a = m[q] * s[2 * MCOL[q]] - m[NM + q] * s[2 * MCOL[q] + 1];
            const double c = m[q] * s[2 * MCOL[q] + 1] + m[NM + q] * s[2 * MCOL[q]];
            re += a;
            im += c;
            size += fabs(a) + fabs(c);
        }
        if (fabs(re) + fabs(im) > LARGEST_REST * size) return 0;
    }
    return 1;
}

static void factorise_nodes(const double *u, const double *p, const double *c) {
    static double m[2 * NM], row[2 * NB], cw[NW];
    const double *arg[] = {u, p, c};
    double *res[] = {m}, *lu = factors.lu, *inverse = factors.inverse;
    nodal_values_code(arg, res, cw);
    for (int i = 0; i < NB; ++i) {
        for (int q = ROW[i]; q < ROW[i + 1]; ++q) row[2 * COL[q]] = row[2 * COL[q] + 1] = 0;
        for (int q = MROW[i]; q < MROW[i + 1]; ++q) {
            row[2 * MCOL[q]] = m[q];
            row[2 * MCOL[q] + 1] = m[NM + q];
        }
        for (int q = ROW[i]; q < DIAG[i]; ++q) {
            const int k = COL[q];
            const double re = row[2 * k] * inverse[2 * k] - row[2 * k + 1] * inverse[2 * k + 1];
            const double im = row[2 * k] * inverse[2 * k + 1] + row[2 * k + 1] * inverse[2 * k];
            row[2 * k] = re;
            row[2 * k + 1] = im;
            for (int r = DIAG[k] + 1; r < ROW[k + 1]; ++r) {
                row[2 * COL[r]] -= re * lu[2 * r] - im * lu[2 * r + 1];
                row[2 * COL[r] + 1] -= re * lu[2 * r + 1] + im * lu[2 * r];
            }
        }
        for (int q = ROW[i]; q < ROW[i + 1]; ++q) {
            lu[2 * q] = row[2 * COL[q]];
            lu[2 * q + 1] = row[2 * COL[q] + 1];
        }
        const double square = row[2 * i] * row[2 * i] + row[2 * i + 1] * row[2 * i + 1];
        inverse[2 * i] = row[2 * i] / square;
        inverse[2 * i + 1] = -row[2 * i + 1] / square;
    }
    if (!accurate(m))
        for (int i = 0; i < 2 * NB; ++i) inverse[i] = NAN; /* no voltage is finite then, which the instance reports */
    memcpy(factors.parameters, p, NP * sizeof *p);
    memcpy(factors.parameters + NP, c, NC * sizeof *c);
    for (int k = 0; k < NG; ++k) factors.inputs[k] = u[GIVEN[k]];
    factors.there = 1;
}

/* v: real parts by bus, then imaginary parts. */
static void solve_nodes(const double **known, double *v) {
    static double b[2 * NB], s[2 * NB], cw[NW];
    double *res[] = {b};
    if (!unchanged(known[1], known[2], known[3])) factorise_nodes(known[1], known[2], known[3]);
    nodal_currents_code(known, res, cw);
    through_factors(b, s);
    for (int i = 0; i < NB; ++i) {
        v[PERM[i]] = s[2 * i];
        v[NB + PERM[i]] = s[2 * i + 1];
    }
}

static void outputs_code(const double **arg, double **res, double *w) {
    double v[2 * NB];
    const double *known[] = {arg[0], arg[1], arg[2], arg[3], v};
    solve_nodes(known, v);
    outputs_at_code(known, res, w);
}

static void derivatives_code(const double **arg, double **res, double *w) {
    double v[2 * NB];
    const double *known[] = {arg[0], arg[1], arg[2], arg[3], v};
    solve_nodes(known, v);
    derivatives_at_code(known, res, w);
}
