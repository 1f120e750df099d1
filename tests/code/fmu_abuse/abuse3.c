/* Calls the functions of FMI 3.0 in random order, with arguments right and wrong; nothing may crash, leak or write beyond. */
#include "fmi3.c"

#include <math.h>
#include <stdio.h>

static unsigned long seed;

static unsigned draw(unsigned n)
{
    seed = seed * 6364136223846793005UL + 1442695040888963407UL;
    return (unsigned)(seed >> 33) % n;
}

static void logger(fmi3Environment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment, (void)status, (void)category, (void)message;
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

static void call(fmi3Instance c, fmi3FMUState *states, uint8_t *bytes, size_t size)
{
    unsigned vr[MOST], vr_known[MOST];
    double values[MOST], result[MOST];
    fmi3Boolean flags[4];
    double last;
    bool truths[MOST] = {false};
    int64_t longs[MOST] = {0};
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
    case 0: fmi3SetDebugLogging(c, true, 0, NULL); break;
    case 1: case 2: fmi3EnterInitializationMode(c, draw(2) == 0, number(), draw(3) ? 0.0 : number(), false, number()); break;
    case 3: case 4: fmi3ExitInitializationMode(c); break;
    case 5: fmi3Terminate(c); break;
    case 6: case 7: fmi3Reset(c); break;
    case 8: case 9: case 10: fmi3GetFloat64(c, wrong ? NULL : vr, n, values, draw(40) ? n : draw(MOST)); break;
    case 11: case 12: /* inputs and parameters, or anything */
        for (int i = 0; draw(5) > 0 && i < MOST; i++) {
            vr[i] = FMU_AT_U + (FMU_N_U + FMU_N_P > 0 ? draw(FMU_N_U + FMU_N_P) : 0u);
        }
        fmi3SetFloat64(c, vr, n, wrong ? NULL : values, draw(40) ? n : draw(MOST));
        break;
    case 13: fmi3GetInt64(c, vr, draw(2), longs, 0); break;
    case 14: fmi3SetBoolean(c, vr, draw(2), truths, 0); break;
    case 15: fmi3GetFMUState(c, wrong ? NULL : &states[which]); break;
    case 16: if (states[which] != NULL) fmi3SetFMUState(c, states[which]); else fmi3SetFMUState(c, NULL); break;
    case 17: fmi3FreeFMUState(c, &states[which]); break;
    case 18: fmi3SerializedFMUStateSize(c, states[which], &found); break;
    case 19: if (states[which] != NULL) fmi3SerializeFMUState(c, states[which], bytes, draw(4) ? size : draw((unsigned)size)); break;
    case 20: fmi3DeserializeFMUState(c, bytes, draw(4) ? size : draw((unsigned)size), &states[which]); break;
    case 21: case 22:
        for (int i = 0; draw(5) > 0 && i < MOST; i++) {
            vr[i] = FMU_AT_RATES + draw(FMU_N_X), vr_known[i] = draw(FMU_N_X);
        }
        fmi3GetDirectionalDerivative(c, vr, n, vr_known, n_known, values, n_known, wrong ? NULL : result, n); break;
    case 23: fmi3EnterEventMode(c); break;
    case 24: case 25: fmi3UpdateDiscreteStates(c, wrong ? NULL : flags, flags + 1, flags + 2, flags + 3, truths, &last); break;
    case 26: fmi3EnterContinuousTimeMode(c); break;
    case 27: fmi3CompletedIntegratorStep(c, true, flags, wrong ? NULL : flags + 1); break;
    case 28: fmi3SetTime(c, number()); break;
    case 29: fmi3SetContinuousStates(c, values, draw(30) ? FMU_N_X : n); break;
    case 30: fmi3GetContinuousStateDerivatives(c, result, draw(30) ? FMU_N_X : n); break;
    case 31: fmi3GetEventIndicators(c, result, draw(30) ? FMU_N_EVENTS : n); break;
    case 32: fmi3GetContinuousStates(c, result, draw(30) ? FMU_N_X : n); break;
    case 33: fmi3GetNominalsOfContinuousStates(c, result, draw(30) ? FMU_N_X : n); break;
    case 34: case 35: fmi3DoStep(c, draw(3) ? (c != NULL ? INSTANCE->m.t : 0.0) : number(), draw(8) ? 1e-4 : fmin(number(), 1.0) * 1e-3, true, flags, flags + 1, flags + 2, wrong ? NULL : &last); break;
    case 36: fmi3GetNumberOfEventIndicators(c, &found); fmi3EnterConfigurationMode(draw(9) ? NULL : c); break;
    default: fmi3SetDebugLogging(c, draw(2) == 0, 0, NULL);
    }
}

int main(int argc, char **argv)
{
    static uint8_t bytes[sizeof(fmu_snapshot)];
    (void)argc;
    for (unsigned long run = 0; run < strtoul(argv[1], NULL, 10); run++) {
        seed = run * 7919 + 1;
        fmi3FMUState states[4] = {NULL, NULL, NULL, NULL};
        const fmi3Instance c = draw(20) == 0 ? NULL
                                              : create(draw(30) ? "i" : NULL, draw(30) ? FMU_TOKEN : "other", draw(2) == 0, NULL, draw(40) ? logger : NULL, (int)draw(2));
        for (unsigned k = draw(120); k > 0; k--) {
            call(c, states, bytes, sizeof bytes);
        }
        for (int i = 0; i < 4; i++) {
            free(states[i]);
        }
        fmi3FreeInstance(c);
    }
    return puts("done") < 0;
}
