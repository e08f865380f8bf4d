/* ncgen_rates.c: one velocity after the other, each by a change that leaves those before it. */
#include "ncgen_rates.h"
#include "ncgen_vectors.h"

/* A velocity follows from others where less than this share of its mobility is left; how far it may be off, over all velocities. */
static const ncgen_scalar follows = R(1.0e-12), reached = R(1.0e-9);

int ncgen_set_rates(int n, int count, const int *places, int stride, const ncgen_real *wanted, const ncgen_scalar *sizes,
    ncgen_real *responses, ncgen_real *qd)
{
    for (int a = 0; a < count; ++a) {
        ncgen_real *own = responses + (size_t)a * (size_t)n;
        const int place = places[a * stride];
        const ncgen_real whole = own[place];
        for (int b = 0; b < a; ++b) {
            const ncgen_real *other = responses + (size_t)b * (size_t)n;
            const int before = places[b * stride];
            const ncgen_real share = other[before] > 0 ? own[before] / other[before] : 0;
            for (int j = 0; j < n; ++j)
                own[j] -= share * other[j];
        }
        const int moves = own[place] > follows * whole; /* else it follows from the others, or cannot change */
        const ncgen_real change = moves ? (wanted[a] - qd[place]) / own[place] : 0;
        for (int j = 0; j < n; ++j) {
            own[j] = moves ? own[j] : 0;
            qd[j] += change * own[j];
        }
    }
    ncgen_scalar most = 0;
    int worst = -1;
    for (int a = 0; a < count; ++a) {
        const int place = places[a * stride];
        const ncgen_scalar off = NCGEN_ABS(qd[place] - wanted[a]) / sizes[place];
        const ncgen_scalar allowed = reached * (ncgen_largest(n, qd, sizes) + NCGEN_ABS(wanted[a]) / sizes[place]);
        if (off > allowed && off > most) {
            most = off;
            worst = a;
        }
    }
    return worst;
}
