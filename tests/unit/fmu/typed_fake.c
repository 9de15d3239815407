/* An FMI 3 unit with outputs of several types and an array: the good fake, with some getters of its own. */
#define fmi3GetFloat64 scalar_get_float64
#define fmi3GetInt32 scalar_get_int32
#define fmi3GetString scalar_get_string
#include "face3.c"
#undef fmi3GetFloat64
#undef fmi3GetInt32
#undef fmi3GetString

enum { VECTOR = 100, COUNT, LABEL };

FACE(fmi3Status) fmi3GetFloat64(REFS, fmi3Float64 value[], size_t n)
{
    size_t at = 0;
    for (size_t k = 0; k < nvr; k++) {
        size_t size = vr[k] == VECTOR ? 3 : 1;
        if (at + size > n) return fmi3Error;
        if (size == 1 && scalar_get_float64(c, vr + k, 1, value + at, 1) > fmi3Warning) return fmi3Error;
        for (size_t i = 0; size == 3 && i < 3; i++) value[at + i] = ((Instance *)c)->now.model.time + (double)i;
        at += size;
    }
    return at == n ? fmi3OK : fmi3Error;
}

FACE(fmi3Status) fmi3GetInt32(REFS, fmi3Int32 value[], size_t n)
{
    if (nvr != 1 || vr[0] != COUNT || n != 1) return fmi3Error;
    value[0] = (fmi3Int32)(((Instance *)c)->now.model.time * 1000.0 + 0.5);
    return fmi3OK;
}

FACE(fmi3Status) fmi3GetString(REFS, fmi3String value[], size_t n)
{
    (void)c;
    if (nvr != 1 || vr[0] != LABEL || n != 1) return fmi3Error;
    value[0] = "fine";
    return fmi3OK;
}
