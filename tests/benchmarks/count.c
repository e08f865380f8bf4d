/* count.c: calls one function of a library many times, for callgrind to count its instructions.
 *
 * Usage: count LIBRARY FUNCTION KIND < NUMBERS, where KIND is position or velocity, newton or acceleration of the ncgen_dynamics
 * that FUNCTION returns, or derivative of the ncgen_motion that it returns. NUMBERS: how many q, velocities, p and results there are, then q, velocities, p.
 */
#include "ncgen_runtime.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TIMES = 1000 };

/* A symbol is a data pointer for dlsym; ISO C has no conversion to a function. */
typedef union symbol {
    void *data;
    ncgen_position_kernel *position;
    ncgen_velocity_kernel *velocity;
    const ncgen_dynamics *(*dynamics)(void);
    const ncgen_motion *(*motion)(void);
} symbol;

/* So many numbers from stdin, and room for more. */
static double *numbers(int count, int more)
{
    double *x = calloc((size_t)(count + more) + 1, sizeof(double));
    for (int i = 0; x && i < count; ++i)
        if (scanf("%lf", &x[i]) != 1)
            return NULL;
    return x;
}

int main(int count, char **arguments)
{
    int n_q, n_v, n_p, n_out, status = 0;
    void *library = count == 4 ? dlopen(arguments[1], RTLD_NOW) : NULL;
    symbol found;
    found.data = library ? dlsym(library, arguments[2]) : NULL;
    if (!found.data || scanf("%d %d %d %d", &n_q, &n_v, &n_p, &n_out) != 4)
        return 2;
    const char *kind = arguments[3];
    const ncgen_motion *motion = strcmp(kind, "derivative") == 0 ? found.motion() : NULL;
    const double *q = numbers(n_q, 0), *v = numbers(n_v, 0);
    double *p = numbers(n_p, motion ? motion->n_prepared : 0);
    double *out = calloc((size_t)n_out, sizeof(double));
    if (!q || !v || !p || !out)
        return 2;
    if (motion && motion->prepare)
        status |= motion->prepare(p, p + n_p);
    ncgen_position_kernel *position = NULL;
    ncgen_velocity_kernel *velocity = NULL;
    if (motion)
        velocity = motion->derivative;
    else if (strcmp(kind, "newton") == 0)
        position = found.dynamics()->newton;
    else if (strcmp(kind, "acceleration") == 0)
        velocity = found.dynamics()->acceleration;
    else if (strcmp(kind, "position") == 0)
        position = found.position;
    else
        velocity = found.velocity;
    for (int i = 0; i < TIMES; ++i)
        status |= position ? position(0.0, q, p, out) : velocity(0.0, q, v, p, out);
    return status;
}
