/* What the states of a network reach in its solution. From stage to stage of a step the states alone change: only these
   currents are computed, only these rows swept and only these voltages found anew, to the same bits. */

/* Lists in the workspace, behind what the solution keeps. Rows are in order of elimination. */
static void place_reach(double *w, int32_t *at) {
    struct reach *r = &OF(w)->reach;
    const struct section s = OF(w)->size.section[CURRENTS];
    r->down = at;
    r->from = r->down + NB;
    r->up = r->from + NB;
    r->current = r->up + NB;
    r->run = r->current + 2 * NB;
    r->place = r->run + 2 * s.runs;
    r->operand = (uint32_t *)r->place + s.operands; /* no operation is without one */
}
#define REACH_WORDS(s) (5 * (int64_t)(s).size.rank + 2 * (int64_t)(s).size.section[CURRENTS].runs + \
                        2 * (int64_t)(s).size.section[CURRENTS].operands)

/* Mark the results of the currents that depend on a state, and list them. */
static void find_moved_currents(double *w) {
    struct reach *r = &OF(w)->reach;
    const struct section s = OF(w)->size.section[CURRENTS];
    const uint32_t *run = OF(w)->run[CURRENTS], *at = OF(w)->operand[CURRENTS];
    double *mark = SLOT, *out = SLOT + AT_FIXED + OF(w)->size.fixed;
    for (int k = 0; k < NX; ++k) mark[X + k] = 1;
    for (int k = 0; k < s.runs; ++k)
        for (uint32_t n = 0; n < run[2 * k + 1]; ++n, ++out)
            for (int side = 0; side < TAKES[run[2 * k]]; ++side)
                if (mark[*at++]) *out = 1;
    for (int k = 0; k < s.results; ++k)
        if (mark[OF(w)->result[CURRENTS][k]]) r->current[r->currents++] = k;
}

/* List the operations that the moved currents need, run by run. */
static void find_operations(double *w) {
    struct reach *r = &OF(w)->reach;
    const struct section s = OF(w)->size.section[CURRENTS];
    const uint32_t *run = OF(w)->run[CURRENTS], *at = OF(w)->operand[CURRENTS];
    const int first = AT_FIXED + OF(w)->size.fixed;
    double *mark = SLOT;
    int out = first;
    memset(mark, 0, (size_t)OF(w)->size.slots * sizeof *mark);
    for (int k = 0; k < r->currents; ++k) mark[OF(w)->result[CURRENTS][r->current[k]]] = 1;
    for (int k = 0; k < s.runs; ++k) out += (int)run[2 * k + 1];
    const uint32_t *behind = at + s.operands;
    for (int k = s.runs - 1; k >= 0; --k)
        for (uint32_t n = 0; n < run[2 * k + 1]; ++n) {
            behind -= TAKES[run[2 * k]];
            if (!mark[--out]) continue;
            for (int side = 0; side < TAKES[run[2 * k]]; ++side) mark[behind[side]] = 1;
        }
    int places = 0, operands = 0;
    for (int k = 0; k < s.runs; ++k) {
        const int before = places, takes = TAKES[run[2 * k]];
        for (uint32_t n = 0; n < run[2 * k + 1]; ++n, ++out, at += takes) {
            if (!mark[out]) continue;
            r->place[places++] = out;
            for (int side = 0; side < takes; ++side) r->operand[operands++] = at[side];
        }
        if (places == before) continue;
        r->run[2 * r->runs] = (int32_t)run[2 * k];
        r->run[2 * r->runs++ + 1] = places - before;
    }
}

/* List the rows whose sweep down changes with the moved currents. */
static void find_rows_down(double *w) {
    struct reach *r = &OF(w)->reach;
    double *mark = SLOT, *swept = SLOT + NB; /* by bus; by row */
    memset(mark, 0, 2 * (size_t)NB * sizeof *mark);
    for (int k = 0; k < r->currents; ++k) mark[r->current[k] % NB] = 1;
    for (int i = 0; i < NB; ++i) {
        int q = ROW[i];
        while (!mark[PERM[i]] && q < DIAG[i] && !swept[COL[q]]) ++q;
        if (!mark[PERM[i]] && q == DIAG[i]) continue;
        swept[i] = 1;
        r->from[r->n_down] = q;
        r->down[r->n_down++] = i;
    }
}

static void want_voltage(double *w, double *wanted, uint32_t slot) {
    if (slot >= (uint32_t)AT_V && slot < (uint32_t)AT_GH) wanted[(slot - (uint32_t)AT_V) % (uint32_t)NB] = 1;
}

/* List the rows, from the last on, that the voltages behind the states' rates need. */
static void find_rows_up(double *w) {
    struct reach *r = &OF(w)->reach;
    const struct section s = OF(w)->size.section[DERIVATIVES];
    double *wanted = SLOT, *needed = SLOT + NB; /* by bus; by row */
    memset(wanted, 0, 2 * (size_t)NB * sizeof *wanted);
    for (int k = 0; k < s.operands; ++k) want_voltage(w, wanted, OF(w)->operand[DERIVATIVES][k]);
    for (int k = 0; k < s.results; ++k) want_voltage(w, wanted, OF(w)->result[DERIVATIVES][k]);
    for (int i = 0; i < NB; ++i) {
        if (!wanted[PERM[i]] && !needed[i]) continue;
        needed[i] = 1;
        for (int q = DIAG[i] + 1; q < ROW[i + 1]; ++q) needed[COL[q]] = 1;
    }
    for (int i = NB - 1; i >= 0; --i)
        if (needed[i]) r->up[r->n_up++] = i;
}

/* Fill the lists; the slots serve as marks, and are 0 before and after. */
static void find_reach(double *w) {
    if (!NB) return;
    find_moved_currents(w);
    find_operations(w);
    find_rows_down(w);
    find_rows_up(w);
    memset(SLOT, 0, (size_t)OF(w)->size.slots * sizeof *w);
}
