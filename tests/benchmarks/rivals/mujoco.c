/* An open tree of hinges in MuJoCo, with the face of a kernel: accelerations of the angles by mj_forward. */
#include <mujoco/mujoco.h>

enum { MOST = 1000 };

static const mjModel *model;
static mjData *data;
static int places[MOST], rates[MOST];
static double signs[MOST];

/* place, rate: of every angle in q and among the rates; sign: of its turn */
void mujoco_make(unsigned long long own_model, unsigned long long own_data, const int *place, const int *rate, const double *sign)
{
    model = (const mjModel *)own_model;
    data = (mjData *)own_data;
    for (int i = 0; i < model->nv; ++i) {
        places[i] = place[i];
        rates[i] = rate[i];
        signs[i] = sign[i];
    }
}

int mujoco_gamma(double t, const double *q, const double *qd, const double *p, double *out)
{
    (void)t, (void)p;
    for (int i = 0; i < model->nv; ++i) {
        data->qpos[i] = signs[i] * q[places[i]];
        data->qvel[i] = signs[i] * qd[rates[i]];
    }
    mj_forward(model, data);
    for (int i = 0; i < model->nv; ++i)
        out[rates[i]] = signs[i] * data->qacc[i];
    return 0;
}
