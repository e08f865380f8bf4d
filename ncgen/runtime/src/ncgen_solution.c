/* ncgen_solution.c: solutions of [M Phi_q'; Phi_q -E] by its factors, refined where these have lost digits, and refused where that does not
 * help.
 */
#include "ncgen_solution.h"

enum { REFINEMENT_LIMIT = 20 };

/* w->residual = w->right - [M Phi_q'; Phi_q 0] w->solution, with the diagonal -E where it is meant to stay. */
static void find_residual(ncgen_run *r, ncgen_constrained *w, int with_diagonal)
{
    const ncgen_pattern *phi_q = &r->model->phi_q_pattern;
    const ncgen_real *values = w->kkt.values + w->n_mass;
    ncgen_real *rest = w->residual;
    ncgen_times_mass(r, w->kkt.values, w->solution, rest);
    for (int i = 0; i < r->n; ++i)
        rest[i] = w->right[i] - rest[i];
    for (int i = 0; i < r->m; ++i) {
        const ncgen_real lam = w->solution[r->n + i];
        ncgen_real sum = w->right[r->n + i] + (with_diagonal ? w->diagonal[i] * lam : 0);
        for (int k = phi_q->indptr[i]; k < phi_q->indptr[i + 1]; ++k) {
            sum -= values[k] * w->solution[phi_q->indices[k]];
            rest[phi_q->indices[k]] -= values[k] * lam;
        }
        rest[r->n + i] = sum;
    }
}

/* Are the factors those of the equations, to nearly all digits? They are not where a diagonal stands in for pivots, nor where pivots
 * have become small: that shows in the pivots, and near a singular position in projected stages and in the growth of the recursion. */
static int factors_are_exact(const ncgen_run *r, const ncgen_constrained *w)
{
    const int pivots_are_small = r->projecting || (w->is_recursive && !(w->pivot_growth < R(1.0e4)));
    const int has_lost_digits = w->kkt.perturbed || w->kkt.weak || w->kkt.let_go > w->left_out;
    return !(pivots_are_small || has_lost_digits || w->iterated || r->dynamics->singular_mass || r->rounding > R(1.0e-10));
}

/* How large accelerations are that the right side can cause, in natural sizes: what a solution that is nearly nothing is measured by. */
static ncgen_real size_of_problem(const ncgen_run *r, const ncgen_constrained *w)
{
    ncgen_real largest = ncgen_constrained_violation(r, w->right + r->n);
    const ncgen_real size = ncgen_constrained_size(r, w->solution);
    largest = size > largest ? size : largest;
    for (int i = 0; i < r->n; ++i) {
        const ncgen_real alone = NCGEN_ABS(w->right[i]) / (w->natural[i] * r->dynamics->column_sizes[i]);
        largest = alone > largest ? alone : largest;
    }
    return largest;
}

ncgen_real ncgen_rest_of_rows(const ncgen_run *r, const ncgen_constrained *w)
{
    ncgen_real largest = 0;
    for (int i = 0; i < r->m; ++i) {
        const ncgen_real rest = NCGEN_ABS(w->residual[r->n + i]) / r->dynamics->row_sizes[i];
        largest = !w->is_left_out[i] && !(rest <= largest) ? rest : largest;
    }
    return largest;
}

/* Is a change at rounding of the solution, or where that is nearly nothing, at rounding of the rounding of what it is the difference of? */
static int is_nothing(const ncgen_run *r, const ncgen_constrained *w, ncgen_real change, ncgen_real size)
{
    const ncgen_real solution = ncgen_constrained_size(r, w->solution), least = r->rounding * size;
    return change <= 4 * r->rounding * (solution > least ? solution : least);
}

/* w->solution of the equations with the right side w->right; refined where the factors are not exact. The last change is about the error
 * then; rows that got no multiplier, though no others imply them, have to be satisfied all the same. */
int ncgen_constrained_solve(ncgen_run *r)
{
    ncgen_constrained *w = r->constrained;
    ncgen_kkt_solve(&w->kkt, w->right, w->solution);
    if (factors_are_exact(r, w))
        return NCGEN_OK;
    const ncgen_real size = size_of_problem(r, w);
    ncgen_real before = 0, rest = 0;
    for (int k = 0; k < REFINEMENT_LIMIT; ++k) {
        find_residual(r, w, r->options->formalism == NCGEN_PENALTY);
        if (w->kkt.let_go > w->left_out)
            rest = ncgen_rest_of_rows(r, w);
        ncgen_kkt_solve(&w->kkt, w->residual, w->residual);
        const ncgen_real change = ncgen_constrained_size(r, w->residual);
        if (k > 0 && !(change < R(0.5) * before)) /* at rounding, or beyond what the equations determine */
            break;
        for (int i = 0; i < r->n + r->m; ++i)
            w->solution[i] += w->residual[i];
        r->statistics->refinements += 1;
        before = change;
        if (is_nothing(r, w, change, size))
            break;
    }
    const ncgen_real enough = NCGEN_SQRT(r->rounding) * size;
    return before <= enough && !(rest > enough) ? NCGEN_OK : NCGEN_SINGULAR;
}
