/* ncgen_tree_records.h: the records of an open tree. */
#ifndef NCGEN_TREE_RECORDS_H
#define NCGEN_TREE_RECORDS_H

#include "ncgen_tree_work.h"

void ncgen_tree_layout(ncgen_run *r, ncgen_tree_work *w);

/* M at a position and what inertias need of it, unless it is constant and known. Before anything else is asked of the records. */
void ncgen_tree_mass_at(const ncgen_run *r, ncgen_tree_work *w, ncgen_scalar t, const ncgen_real *q);

#endif
