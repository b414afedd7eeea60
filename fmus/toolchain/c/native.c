/* A native FMU without a model of its own: all but the functions of one version of FMI, which follow. */
#define TAPE static
#include "tape.c"
#include "directions.c"
#include "model.c"
#include "instance.c"
