/* Calls the functions of FMI 2.0 or 3.0 (VERSION) in random order, with arguments right and wrong; nothing may crash, leak or write beyond. */
#if VERSION == 2
#include "fmi2.c"
#define F(name) fmi2##name
#define MORE(...)
#define fmi2Instance fmi2Component
#define fmi2FMUState fmi2FMUstate
#define fmi2GetFMUState fmi2GetFMUstate
#define fmi2SetFMUState fmi2SetFMUstate
#define fmi2FreeFMUState fmi2FreeFMUstate
#define fmi2SerializedFMUStateSize fmi2SerializedFMUstateSize
#define fmi2SerializeFMUState fmi2SerializeFMUstate
#define fmi2DeserializeFMUState fmi2DeSerializeFMUstate
#define fmi2GetContinuousStateDerivatives fmi2GetDerivatives
#define fmi2GetFloat64 fmi2GetReal
#define fmi2SetFloat64 fmi2SetReal
#define fmi2GetInt64 fmi2GetInteger
typedef char byte;
#else
#include "fmi3.c"
#define F(name) fmi3##name
#define MORE(...) , __VA_ARGS__
typedef uint8_t byte;
#endif

#include <math.h>
#include <stdio.h>

static unsigned long seed;

static unsigned draw(unsigned n)
{
    seed = seed * 6364136223846793005UL + 1442695040888963407UL;
    return (unsigned)(seed >> 33) % n;
}

#if VERSION == 2
static void logger(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category, (void)message;
}
static const fmi2CallbackFunctions functions = {logger, calloc, free, NULL, NULL};
#else
static void logger(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment, (void)status, (void)category, (void)message;
}
#endif

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

static void call(F(Instance) c, F(FMUState) *states, byte *bytes, size_t size)
{
    unsigned vr[MOST], vr_known[MOST];
    double values[MOST], result[MOST];
#if VERSION == 2
    fmi2EventInfo info;
    int truths[MOST] = {0}, longs[MOST] = {0}, *const flags = longs;
#else
    double last;
    bool truths[MOST] = {false}, flags[4];
    int64_t longs[MOST] = {0};
#endif
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
#if VERSION == 2
    case 0: fmi2SetupExperiment(c, (int)draw(2), number(), draw(3) ? 0.0 : number(), (int)draw(2), number()); break;
    case 1: case 2: fmi2EnterInitializationMode(c); break;
#else
    case 0: fmi3SetDebugLogging(c, true, 0, NULL); break;
    case 1: case 2: fmi3EnterInitializationMode(c, draw(2) == 0, number(), draw(3) ? 0.0 : number(), false, number()); break;
#endif
    case 3: case 4: F(ExitInitializationMode)(c); break;
    case 5: F(Terminate)(c); break;
    case 6: case 7: F(Reset)(c); break;
    case 8: case 9: case 10: F(GetFloat64)(c, wrong ? NULL : vr, n, values MORE(draw(40) ? n : draw(MOST))); break;
    case 11: case 12: /* inputs and parameters, or anything */
        for (int i = 0; draw(5) > 0 && i < MOST; i++) {
            vr[i] = FMU_AT_U + (FMU_N_U + FMU_N_P > 0 ? draw(FMU_N_U + FMU_N_P) : 0u);
        }
        F(SetFloat64)(c, vr, n, wrong ? NULL : values MORE(draw(40) ? n : draw(MOST)));
        break;
    case 13: F(GetInt64)(c, vr, draw(2), longs MORE(0)); break;
    case 14: F(SetBoolean)(c, vr, draw(2), truths MORE(0)); break;
    case 15: F(GetFMUState)(c, wrong ? NULL : &states[which]); break;
    case 16: if (states[which] != NULL) F(SetFMUState)(c, states[which]); else F(SetFMUState)(c, NULL); break;
    case 17: F(FreeFMUState)(c, &states[which]); break;
    case 18: F(SerializedFMUStateSize)(c, states[which], &found); break;
    case 19: if (states[which] != NULL) F(SerializeFMUState)(c, states[which], bytes, draw(4) ? size : draw((unsigned)size)); break;
    case 20: F(DeserializeFMUState)(c, bytes, draw(4) ? size : draw((unsigned)size), &states[which]); break;
    case 21: case 22:
        for (int i = 0; draw(5) > 0 && i < MOST; i++) {
            vr[i] = FMU_AT_RATES + draw(FMU_N_X), vr_known[i] = draw(FMU_N_X);
        }
        F(GetDirectionalDerivative)(c, vr, n, vr_known, n_known, values MORE(n_known), wrong ? NULL : result MORE(n)); break;
    case 23: F(EnterEventMode)(c); break;
#if VERSION == 2
    case 24: case 25: fmi2NewDiscreteStates(c, wrong ? NULL : &info); break;
#else
    case 24: case 25: fmi3UpdateDiscreteStates(c, wrong ? NULL : flags, flags + 1, flags + 2, flags + 3, truths, &last); break;
#endif
    case 26: F(EnterContinuousTimeMode)(c); break;
    case 27: F(CompletedIntegratorStep)(c, 1, flags, wrong ? NULL : flags + 1); break;
    case 28: F(SetTime)(c, number()); break;
    case 29: F(SetContinuousStates)(c, values, draw(30) ? FMU_N_X : n); break;
    case 30: F(GetContinuousStateDerivatives)(c, result, draw(30) ? FMU_N_X : n); break;
    case 31: F(GetEventIndicators)(c, result, draw(30) ? FMU_N_EVENTS : n); break;
    case 32: F(GetContinuousStates)(c, result, draw(30) ? FMU_N_X : n); break;
    case 33: F(GetNominalsOfContinuousStates)(c, result, draw(30) ? FMU_N_X : n); break;
    case 34: case 35:
        F(DoStep)(c, draw(3) ? (c != NULL ? INSTANCE->m.t : 0.0) : number(), draw(8) ? 1e-4 : fmin(number(), 1.0) * 1e-3, 1
            MORE(flags, flags + 1, flags + 2, wrong ? NULL : &last));
        break;
#if VERSION == 2
    case 36: fmi2GetRealStatus(c, (int)draw(5), values); fmi2GetBooleanStatus(c, (int)draw(5), wrong ? NULL : truths); break;
#else
    case 36: fmi3GetNumberOfEventIndicators(c, &found); fmi3EnterConfigurationMode(draw(9) ? NULL : c); break;
#endif
    default: F(SetDebugLogging)(c, draw(2) == 0, 0, NULL);
    }
}

int main(int argc, char **argv)
{
    static byte bytes[sizeof(fmu_snapshot)];
    (void)argc;
    for (unsigned long run = 0; run < strtoul(argv[1], NULL, 10); run++) {
        seed = run * 7919 + 1;
        F(FMUState) states[4] = {NULL, NULL, NULL, NULL};
        F(Instance) c = NULL;
        if (draw(20) != 0) {
#if VERSION == 2
            c = fmi2Instantiate(draw(30) ? "i" : NULL, (int)draw(2) + (draw(40) == 0), draw(30) ? FMU_TOKEN : "other", NULL, draw(40) ? &functions : NULL, 0, (int)draw(2));
#else
            c = create(draw(30) ? "i" : NULL, draw(30) ? FMU_TOKEN : "other", draw(2) == 0, NULL, draw(40) ? logger : NULL, (int)draw(2));
#endif
        }
        for (unsigned k = draw(120); k > 0; k--) {
            call(c, states, bytes, sizeof bytes);
        }
        for (int i = 0; i < 4; i++) {
            free(states[i]);
        }
        F(FreeInstance)(c);
    }
    return puts("done") < 0;
}
