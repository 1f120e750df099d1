/* Calls the functions of FMI 2.0 in random order, with arguments right and wrong; nothing may crash, leak or write beyond. */
#include "fmi2.c"

#include <math.h>
#include <stdio.h>

static unsigned long seed;

static unsigned draw(unsigned n)
{
    seed = seed * 6364136223846793005UL + 1442695040888963407UL;
    return (unsigned)(seed >> 33) % n;
}

static void logger(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}

static double number(void)
{
    static const double numbers[] = {0.0, 1.0, -1.0, 0.3, 1e-9, 0.5, 0.2, -0.4, 0.01}, wrong[] = {1e30, 1e308, -1e308, NAN, INFINITY};
    return draw(60) == 0 ? wrong[draw(5)] : numbers[draw(9)];
}

enum { MOST = 64, ROW = 10 };

/* A call that is allowed in a phase: so that sequences get further. */
static unsigned likely(int phase)
{
    static const unsigned calls[7][ROW] = {
        {0, 1, 1, 1, 2, 11, 8, 18, 37, 2},    {3, 3, 4, 8, 11, 21, 30, 31, 3, 15}, {24, 26, 8, 11, 28, 25, 26, 30, 31, 15},
        {27, 28, 29, 30, 31, 32, 23, 8, 21, 22}, {34, 34, 8, 11, 21, 15, 35, 36, 16, 34}, {6, 8, 7, 17, 6, 6, 7, 30, 32, 5},
        {6, 7, 6, 16, 17, 37, 6, 7, 6, 6},
    };
    int at = 0;
    while (at < 6 && (phase >> at & 1) == 0) {
        at++;
    }
    return calls[at][draw(ROW)];
}

static void call(fmi2Component c, fmi2FMUstate *states, char *bytes, size_t size)
{
    unsigned vr[MOST], vr_known[MOST];
    double values[MOST], result[MOST];
    int whole[MOST] = {0};
    fmi2EventInfo info;
    const unsigned n = draw(8) == 0 ? draw(MOST) : draw(4), n_known = draw(5), which = draw(4);
    const int wrong = draw(40) == 0;
    size_t found = 0;
    for (int i = 0; i < MOST; i++) {
        vr[i] = draw(300) == 0 ? draw(1000000) * 5000u : draw(FMU_N_VARIABLES + (draw(100) == 0));
        vr_known[i] = draw(3) == 0 ? draw(FMU_N_VARIABLES) : draw(FMU_N_X);
        values[i] = number();
    }
    const unsigned any_call = draw(38);
    switch (c != NULL && draw(4) > 0 ? likely(INSTANCE->m.phase) : any_call) {
    case 0: fmi2SetupExperiment(c, (int)draw(2), number(), draw(3) ? 0.0 : number(), (int)draw(2), number()); break;
    case 1: case 2: fmi2EnterInitializationMode(c); break;
    case 3: case 4: fmi2ExitInitializationMode(c); break;
    case 5: fmi2Terminate(c); break;
    case 6: case 7: fmi2Reset(c); break;
    case 8: case 9: case 10: fmi2GetReal(c, wrong ? NULL : vr, n, values); break;
    case 11: case 12: /* inputs and parameters, or anything */
        for (int i = 0; draw(5) > 0 && i < MOST; i++) {
            vr[i] = FMU_AT_U + (FMU_N_U + FMU_N_P > 0 ? draw(FMU_N_U + FMU_N_P) : 0u);
        }
        fmi2SetReal(c, vr, n, wrong ? NULL : values);
        break;
    case 13: fmi2GetInteger(c, vr, draw(2), whole); break;
    case 14: fmi2SetBoolean(c, vr, draw(2), whole); break;
    case 15: fmi2GetFMUstate(c, wrong ? NULL : &states[which]); break;
    case 16: if (states[which] != NULL) fmi2SetFMUstate(c, states[which]); else fmi2SetFMUstate(c, NULL); break;
    case 17: fmi2FreeFMUstate(c, &states[which]); break;
    case 18: fmi2SerializedFMUstateSize(c, states[which], &found); break;
    case 19: if (states[which] != NULL) fmi2SerializeFMUstate(c, states[which], bytes, draw(4) ? size : draw((unsigned)size)); break;
    case 20: fmi2DeSerializeFMUstate(c, bytes, draw(4) ? size : draw((unsigned)size), &states[which]); break;
    case 21: case 22:
        for (int i = 0; draw(5) > 0 && i < MOST; i++) {
            vr[i] = FMU_AT_RATES + draw(FMU_N_X), vr_known[i] = draw(FMU_N_X);
        }
        fmi2GetDirectionalDerivative(c, vr, n, vr_known, n_known, values, wrong ? NULL : result); break;
    case 23: fmi2EnterEventMode(c); break;
    case 24: case 25: fmi2NewDiscreteStates(c, wrong ? NULL : &info); break;
    case 26: fmi2EnterContinuousTimeMode(c); break;
    case 27: fmi2CompletedIntegratorStep(c, 1, &whole[0], wrong ? NULL : &whole[1]); break;
    case 28: fmi2SetTime(c, number()); break;
    case 29: fmi2SetContinuousStates(c, values, draw(30) ? FMU_N_X : n); break;
    case 30: fmi2GetDerivatives(c, result, draw(30) ? FMU_N_X : n); break;
    case 31: fmi2GetEventIndicators(c, result, draw(30) ? FMU_N_EVENTS : n); break;
    case 32: fmi2GetContinuousStates(c, result, draw(30) ? FMU_N_X : n); break;
    case 33: fmi2GetNominalsOfContinuousStates(c, result, draw(30) ? FMU_N_X : n); break;
    case 34: case 35: fmi2DoStep(c, draw(3) ? (c != NULL ? INSTANCE->m.t : 0.0) : number(), draw(8) ? 1e-4 : fmin(number(), 1.0) * 1e-3, 1); break;
    case 36: fmi2GetRealStatus(c, (int)draw(5), values); fmi2GetBooleanStatus(c, (int)draw(5), wrong ? NULL : whole); break;
    default: fmi2SetDebugLogging(c, (int)draw(2), 0, NULL);
    }
}

int main(int argc, char **argv)
{
    const fmi2CallbackFunctions functions = {logger, calloc, free, NULL, NULL};
    static char bytes[sizeof(fmu_snapshot)];
    (void)argc;
    for (unsigned long run = 0; run < strtoul(argv[1], NULL, 10); run++) {
        seed = run * 7919 + 1;
        fmi2FMUstate states[4] = {NULL, NULL, NULL, NULL};
        const fmi2Component c = draw(20) == 0 ? NULL
                                              : fmi2Instantiate(draw(30) ? "i" : NULL, (int)draw(2) + (draw(40) == 0), draw(30) ? FMU_TOKEN : "other", NULL, draw(40) ? &functions : NULL, 0, (int)draw(2));
        for (unsigned k = draw(120); k > 0; k--) {
            call(c, states, bytes, sizeof bytes);
        }
        for (int i = 0; i < 4; i++) {
            free(states[i]);
        }
        fmi2FreeInstance(c);
    }
    return puts("done") < 0;
}
