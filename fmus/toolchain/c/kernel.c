/* Functions of a kernel around the generated code. Every quantity of an instance lies in
   one vector z = [p | c | u | x | y | dx]; the sizes NP ... NY stand above, generated.
   A tape's kernel (tape.c) has functions of the same names; integrators give both their workspace. */
#include <math.h>
#include <string.h>
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
#ifndef KERNEL /* a native FMU keeps these functions to itself */
#define KERNEL EXPORT
#endif
enum { C = NP, U = C + NC, X = U + NU, Y = X + NX, DX = Y + NY };
/* A workspace begins with the p and c that its NH fixed values were made of, once there are any, and these values. */
enum { MADE_OF = 1, AT_FIXED = MADE_OF + U, OWN = AT_FIXED + NH };

/* Compute what p and c fix, where they are not as they were. Bytes are compared: a NaN is equal to itself. */
static void enter(const double *z, double *workspace) {
    if (workspace[0] && !memcmp(workspace + MADE_OF, z, U * sizeof *z)) return;
    const double *arg[] = {z, z + C};
    double *res[] = {workspace + AT_FIXED};
    fixed_code(arg, res);
    memcpy(workspace + MADE_OF, z, U * sizeof *z);
    workspace[0] = 1;
}

static void rates(const double *z, const double *x, double *rate, double *workspace) {
    const double *arg[] = {x, z + U, z, z + C, workspace + AT_FIXED};
    double *res[] = {rate};
    derivatives_code(arg, res);
}

KERNEL void initialise(double *z, double *workspace) {
    (void)workspace;
    const double *arg[] = {z};
    double *res[] = {z + C, z + X};
    initialise_code(arg, res);
}

static void read_outputs(double *z, const double *workspace) {
    const double *arg[] = {z + X, z + U, z, z + C, workspace + AT_FIXED};
    double *res[] = {z + Y};
    outputs_code(arg, res);
}

KERNEL void outputs(double *z, double *workspace) {
    enter(z, workspace);
    read_outputs(z, workspace);
}

KERNEL void derivatives(double *z, double *workspace) {
    enter(z, workspace);
    rates(z, z + X, z + DX, workspace);
}

KERNEL void requirements(const double *z, double *workspace, double *r) {
    (void)workspace;
    const double *arg[] = {z, z + C};
    double *res[] = {r};
    requirements_code(arg, res);
}

/* Outputs after a step, or 1 + the index of the first state that is no longer finite. */
static int finish(double *z, double *workspace) {
    for (int i = 0; i < NX; ++i)
        if (!isfinite(z[X + i])) return i + 1;
    read_outputs(z, workspace);
    return 0;
}

#ifdef IMPLICIT /* the matrix of an implicit step */
static void matrix(const double *z, double gh, double *m, double *workspace) {
    const double *arg[] = {z, z + C, &gh};
    double *res[] = {m};
    (void)workspace;
    iteration_code(arg, res);
}
#endif
