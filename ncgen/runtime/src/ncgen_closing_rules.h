/* ncgen_closing_rules.h: how far steps may leave the constraints, and which pivots multiply that; of numbers or of lanes. */
#ifndef NCGEN_CLOSING_RULES_H
#define NCGEN_CLOSING_RULES_H

#include "ncgen_runtime.h"

enum { NCGEN_POSITION_LIMIT = 12 }; /* Newton steps that close a position */

/* A position is not moved that far to close it, in natural sizes; the next Newton step is not taken where it would change but rounding, violations
 * being below a multiple of its root; and what is off by no more roundings than this is on the constraints. */
#define NCGEN_TOO_FAR ((ncgen_scalar)0.1)
#define NCGEN_QUADRATIC ((ncgen_scalar)10)
#define NCGEN_ROUNDINGS ((ncgen_scalar)100)

/* What is straight leaves the constraints by about the square of its length, which is nothing below this share of rounding. */
#define NCGEN_STRAIGHT ((ncgen_scalar)0.01)

/* Growth of pivots from which on the next step goes by the matrix, and this evaluation does. Where a tape is written both are larger, since the
 * matrix leaves nothing to differentiate. */
#define NCGEN_SOON_BAD_GROWTH ((ncgen_scalar)3)
#define NCGEN_BAD_GROWTH ((ncgen_scalar)10)
#define NCGEN_TAPED_GROWTH ((ncgen_scalar)1e6)

/* Small pivots multiply how far velocities of a stage are from those that the joints allow by the root of their growth. A run with a tape goes
 * on with such pivots, and without error control nothing else shows that its steps have a digit less than others: from this growth on velocities
 * may be off by no more than this share of theirs. */
#define NCGEN_GROWTH_OF_A_DIGIT ((ncgen_scalar)100)
#define NCGEN_HARMLESS_SHARE ((ncgen_scalar)1e-4)

#endif
