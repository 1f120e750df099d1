/* MuJoCo behind the interface of rhs_loop.c: mj_forward of a model without contacts. */
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <string.h>

static mjModel *model;
static mjData *data;

int prepare(const char *path)
{
    char error[500] = "";
    model = mj_loadXML(path, NULL, error, sizeof error);
    if (model == NULL) {
        fprintf(stderr, "%s\n", error);
        return 1;
    }
    data = mj_makeData(model);
    return 0;
}

void call(const double *x, const double *u, double *out)
{
    memcpy(data->qpos, x, (size_t)model->nq * sizeof(double));
    memcpy(data->qvel, x + model->nq, (size_t)model->nv * sizeof(double));
    memcpy(data->qfrc_applied, u, (size_t)model->nv * sizeof(double));
    mj_forward(model, data);
    memcpy(out + model->nq, data->qacc, (size_t)model->nv * sizeof(double));
}
