/* ncgen_generalized_alpha.c: the generalized-alpha method for constrained equations of index 3 (Arnold and Bruels 2007). */
#include "ncgen_constrained.h"
#include "ncgen_jacobian.h"
#include "ncgen_steppers.h"

enum { ITERATION_LIMIT = 30 };

/* Phi = 0 and M qdd + Phi_q' lam = Q at the end; positions and velocities follow from the auxiliary accelerations a by
 * Newmark's formulas, and (1 - alpha_m) a1 + alpha_m a0 = (1 - alpha_f) qdd1 + alpha_f qdd0. */
int ncgen_generalized_alpha(ncgen_run *r, ncgen_stepping *w, ncgen_correction *c, ncgen_scalar t, ncgen_scalar h)
{
    const int n = r->n;
    const ncgen_scalar alpha_m = r->options->alpha_m, alpha_f = r->options->alpha_f;
    const ncgen_scalar gamma = R(0.5) - alpha_m + alpha_f, beta = (gamma + R(0.5)) * (gamma + R(0.5)) / 4;
    const ncgen_scalar share = (1 - alpha_f) / (1 - alpha_m), by_q = h * h * beta * share, by_qd = h * gamma * share;
    const ncgen_real *velocity = r->y, *position = r->y + n;
    ncgen_real *a = c->auxiliary, *qdd = r->linearisation->qdd, *lam = r->linearisation->lam, *qd0 = c->base, *q0 = c->base + n;
    ncgen_real last = R(1.0e30);
    for (int i = 0; i < n; ++i) {
        const ncgen_real base = (alpha_f * qdd[i] - alpha_m * a[i]) / (1 - alpha_m); /* a1 = base + share qdd1 */
        q0[i] = position[i] + h * velocity[i] + h * h * ((R(0.5) - beta) * a[i] + beta * base);
        qd0[i] = velocity[i] + h * ((1 - gamma) * a[i] + gamma * base);
        a[i] = base;
        /* Newton starts from the straight motion: accelerations of stiff springs would take it to another branch. */
        qdd[i] = (position[i] + h * velocity[i] - q0[i]) / by_q;
    }
    for (int pass = 0; pass < ITERATION_LIMIT; ++pass) {
        for (int i = 0; i < n; ++i) {
            r->q[i] = q0[i] + by_q * qdd[i];
            r->qd[i] = qd0[i] + by_qd * qdd[i];
        }
        int status = ncgen_find_residual(r, c, t, h);
        if (status == NCGEN_OK)
            status = ncgen_solve_with_multipliers(r, c, by_qd, by_q, c->left, by_q);
        if (status != NCGEN_OK)
            return status;
        for (int i = 0; i < n; ++i) {
            qdd[i] += c->change[i];
            c->change[i] *= by_q;
        }
        for (int i = 0; i < r->m; ++i)
            lam[i] += c->change[n + i];
        const ncgen_real size = ncgen_constrained_size(r, c->change);
        if (ncgen_is_rounding(r, size, last)) {
            for (int i = 0; i < n; ++i) {
                r->q[i] = q0[i] + by_q * qdd[i];
                r->qd[i] = qd0[i] + by_qd * qdd[i];
                a[i] += share * qdd[i];
            }
            return ncgen_end_step(r, w, c, t, h);
        }
        last = size;
    }
    return NCGEN_NOT_CONVERGED;
}
