/* ncgen_contact_laws.h: impulses of contacts that obey the laws of impact. */
#ifndef NCGEN_CONTACT_LAWS_H
#define NCGEN_CONTACT_LAWS_H

#include "ncgen_vectors.h"

/* A contact: the place of its gap among the velocities, with those of its directions of sliding behind it, and coefficients. */
typedef struct ncgen_contact {
    int gap, directions, poisson;
    ncgen_scalar restitution, friction, tangential;
} ncgen_contact;

/* What a contact does: 1 where its gap stays closed, 1 where it slides, and in which direction. */
typedef struct ncgen_manner {
    ncgen_real closed, slides, direction[2];
} ncgen_manner;

/* The laws without restitution: velocities G L + bias, impulses along gaps of at least `least`. */
typedef struct ncgen_laws {
    const int *places; /* as of ncgen_impact */
    const ncgen_scalar *coefficients;
    int from, to, rows; /* the contacts that are meant */
    const ncgen_real *G;
    ncgen_manner *manners;
    ncgen_real *bias, *least, *velocities, *right, *scales, *before, *matrix, *spare, *v;
} ncgen_laws;

ncgen_contact ncgen_contact_of(const int *places, const ncgen_scalar *coefficients, int number);

/* So many contacts with so many velocities. */
void ncgen_lay_out_laws(int count, int rows, const int *places, const ncgen_scalar *coefficients, const ncgen_real *G, ncgen_space *space,
    ncgen_laws *laws);

/* Contacts without friction whose impulses change their velocities by minus bias: those that are not negative, with the least
 * energy of what the laws miss (Lawson and Hanson 1974), since gaps that depend on each other may ask for more than there is. */
void ncgen_push_only(ncgen_laws *laws, ncgen_real *impulses);

/* Contacts with friction, for velocities before: whether there are impulses that obey the laws. first: room for as many numbers */
int ncgen_push_with_friction(ncgen_laws *laws, const ncgen_real *velocities, ncgen_real *first, ncgen_real *impulses);

#endif
