/* ncgen_method.c: the table of methods (ncgen_facts.h), asked. */
#include "ncgen_method.h"
#include "ncgen_facts.h"

int ncgen_is_stepper(const ncgen_options *options)
{
    return facts[options->method].steps_constraints >> options->formalism & 1;
}

/* RATTLE does without where the acceleration at a position is the same before and after it is given its velocity and all rows are
 * equations of position, and energy-momentum unless the options say that it needs them. */
int ncgen_uses_tangents(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    if (ncgen_is_reduced(dynamics, options))
        return 0;
    const int simple = dynamics->conservative && !dynamics->rolling && (!model->mass || model->mass_is_constant);
    if (facts[options->method].tangents == SOMETIMES)
        return dynamics->tangents != NULL || (options->method == NCGEN_RATTLE && !simple);
    return facts[options->method].tangents != NEVER;
}

/* Newton's steps take place in the degrees of freedom where a recursion gives accelerations and every constraint is one on
 * positions. */
int ncgen_is_reduced(const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    const int recurs = dynamics->motion || dynamics->tree;
    return facts[options->method].tangents == UNLESS_RECURSIVE && options->formalism == NCGEN_LAGRANGE && !(options->frequency > 0) && recurs &&
           !dynamics->rolling;
}

int ncgen_is_implicit(const ncgen_options *options)
{
    return !ncgen_is_stepper(options) && facts[options->method].tangents != NEVER;
}

int ncgen_is_fixed_explicit(const ncgen_options *options)
{
    const int is_fixed = facts[options->method].has_fixed_step || !(options->rtol > 0 || options->atol > 0);
    return is_fixed && !ncgen_is_stepper(options) && !ncgen_is_implicit(options);
}

int ncgen_is_possible(const ncgen_model *model, const ncgen_dynamics *dynamics, const ncgen_options *options)
{
    const int partitioned = options->formalism == NCGEN_COORDINATE_PARTITIONING;
#ifdef NCGEN_EXPLICIT_ONLY
    if (ncgen_is_stepper(options) || ncgen_is_implicit(options))
        return 0;
#endif
#ifdef NCGEN_WITHOUT_STEPPERS
    if (ncgen_is_stepper(options))
        return 0;
#endif
#ifdef NCGEN_WITHOUT_PARTITIONING
    if (partitioned)
        return 0;
#endif
#ifdef NCGEN_WITHOUT_TABLES
    if (!partitioned && dynamics->tree && !dynamics->motion)
        return 0;
#endif
    if ((model->n_rows && !model->phi) || options->method < 0 || options->method >= N_METHODS)
        return 0;
    if (options->formalism < 0 || options->formalism >= N_FORMALISMS)
        return 0;
    if (partitioned ? dynamics->n_dependent > 0 && !dynamics->newton && !dynamics->rows : !dynamics->elimination)
        return 0;
    if (ncgen_uses_tangents(model, dynamics, options) && (!dynamics->tangents || (partitioned && dynamics->newton && !dynamics->rows)))
        return 0;
    if (facts[options->method].has_fixed_step && !(options->max_step > 0 || options->max_step < 0))
        return 0;
    return ncgen_is_stepper(options) || (facts[options->method].takes_derivative && options->formalism != NCGEN_ALI3P);
}
