/* ncgen_chain.c: rules of events at one instant. */
#include "ncgen_chain.h"
#include "ncgen_vectors.h"

enum { MOST_ROUNDS = 1000 };

/* A condition is zero where it is smaller than this share of its scale. */
static const ncgen_scalar closed_below = R(1.0e-10);

/* A bounce that stays lower than this many times what has no sign does not count. */
static const ncgen_scalar at_rest = R(50.0);

static int sign_of(ncgen_real x)
{
    return (x > 0) - (x < 0);
}

int ncgen_is_zero(ncgen_scalar value, ncgen_scalar scale)
{
    return NCGEN_ABS(value) <= closed_below * scale;
}

static int is_zero(const ncgen_chain *c, int k)
{
    return ncgen_is_zero(c->pairs[2 * k], c->scales[k]);
}

int ncgen_find_turned(ncgen_chain *c)
{
    int count = 0;
    for (int k = 0; k < c->count; ++k) {
        const int side = sign_of(c->pairs[2 * k]), clear = !is_zero(c, k) && !ncgen_is_zero(c->before[2 * k], c->scales[k]);
        c->due[k] = clear && !c->done[k] && side != sign_of(c->before[2 * k]) && side * c->directions[k] >= 0;
        count += c->due[k];
    }
    return count;
}

int ncgen_follow_chain(ncgen_chain *c)
{
    for (int k = 0; k < c->count; ++k)
        c->happened[k] = c->due[k];
    for (int round = 0; round < MOST_ROUNDS; ++round) {
        ncgen_copy(2 * c->count, c->pairs, c->before);
        for (int k = 0; k < c->count; ++k)
            c->done[k] = c->due[k];
        int status = c->act(c->context);
        if (status == NCGEN_OK)
            status = c->look(c->context);
        if (status != NCGEN_OK || !ncgen_find_turned(c))
            return status;
        for (int k = 0; k < c->count; ++k)
            c->happened[k] |= c->due[k];
    }
    return NCGEN_ENDLESS;
}

int ncgen_find_first(ncgen_chain *c, const ncgen_real *rates, const int *gaps, const int *keeps, int *signs)
{
    for (int k = 0; k < c->count; ++k) {
        const int zero = is_zero(c, k), way = sign_of(rates[k]), side = sign_of(c->pairs[2 * k]);
        if (gaps[k] && side < 0 && !zero)
            return k;
        c->due[k] = zero && way && way * c->directions[k] >= 0 && !keeps[k];
        signs[k] = gaps[k] ? 1 : zero ? way : side;
    }
    return -1;
}

void ncgen_set_sides(const ncgen_chain *c, const int *above, int *signs)
{
    for (int k = 0; k < c->count; ++k) {
        const int way = c->directions[k], now = is_zero(c, k) ? 0 : sign_of(c->pairs[2 * k]);
        if (above[k])
            signs[k] = 1;
        else if (now)
            signs[k] = now;
        else if (c->happened[k])
            signs[k] = way ? way : -signs[k];
    }
}

int ncgen_is_at_rest(ncgen_scalar value, ncgen_scalar scale, ncgen_scalar rate, ncgen_scalar acceleration, ncgen_scalar noise)
{
    const ncgen_scalar deep = NCGEN_ABS(value), least = at_rest * noise * scale, speed = rate > 0 ? rate : 0;
    return acceleration < 0 && speed * speed <= -2 * acceleration * (deep > least ? deep : least);
}

ncgen_scalar ncgen_time_of_bounces(ncgen_scalar rate, ncgen_scalar acceleration, ncgen_scalar restitution)
{
    return rate > 0 && restitution < 1 ? -2 * rate / acceleration / (1 - restitution) : 0;
}
