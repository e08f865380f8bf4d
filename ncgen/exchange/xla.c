/* What XLA calls in the midst of its programs, handed on to Python with where arguments lie and where results are to be, so that nothing
   is copied. c_api.h is what jaxlib brings: XLA's foreign functions in C. */

#include "c_api.h"

/* begin cdef */
#define NCGEN_XLA_LINE 2048

/* Doubles, the last axis first in memory. */
typedef struct {
    int64_t rank;
    const int64_t *sizes;
    void *numbers;
} ncgen_xla_array;

/* function: its number; arrays: its arguments, then its results; line: where a text of NCGEN_XLA_LINE bytes goes that says why there are
   none. Returns 0, or 1 where that was needed. */
typedef int ncgen_xla_fill(int64_t function, int64_t count, const ncgen_xla_array *arrays, char *line);
extern ncgen_xla_fill *ncgen_xla_filling;
/* end cdef */

enum { ARRAYS = 16 };

ncgen_xla_fill *ncgen_xla_filling;

static XLA_FFI_Error *failed(const XLA_FFI_Api *api, const char *line) {
    XLA_FFI_Error_Create_Args error = {0};

    error.struct_size = XLA_FFI_Error_Create_Args_STRUCT_SIZE;
    error.message = line;
    error.errc = XLA_FFI_Error_Code_INVALID_ARGUMENT;
    return api->XLA_FFI_Error_Create(&error);
}

/* XLA asks once for which version of its interface this was compiled. */
static int asks_for_version(const XLA_FFI_Extension_Base *extension) {
    if (extension == NULL || extension->type != XLA_FFI_Extension_Metadata)
        return 0;
    XLA_FFI_Api_Version *version = &((const XLA_FFI_Metadata_Extension *)extension)->metadata->api_version;
    version->major_version = XLA_FFI_API_MAJOR;
    version->minor_version = XLA_FFI_API_MINOR;
    return 1;
}

static ncgen_xla_array array_of(const XLA_FFI_Buffer *buffer) {
    ncgen_xla_array array = {buffer->rank, buffer->dims, buffer->data};

    return array;
}

/* The function's number is the call's only attribute. */
XLA_FFI_Error *ncgen_xla_call(XLA_FFI_CallFrame *call) {
    ncgen_xla_array arrays[ARRAYS];
    char line[NCGEN_XLA_LINE] = "";
    int64_t count = 0;

    if (asks_for_version(call->extension_start) || call->stage != XLA_FFI_ExecutionStage_EXECUTE)
        return NULL;
    if (call->args.size + call->rets.size > ARRAYS || call->attrs.size != 1)
        return failed(call->api, "ncgen: a call of other arrays than were asked for");
    for (int64_t k = 0; k < call->args.size; k++)
        arrays[count++] = array_of(call->args.args[k]);
    for (int64_t k = 0; k < call->rets.size; k++)
        arrays[count++] = array_of(call->rets.rets[k]);
    int64_t function = *(const int64_t *)((const XLA_FFI_Scalar *)call->attrs.attrs[0])->value;
    return ncgen_xla_filling(function, count, arrays, line) ? failed(call->api, line) : NULL;
}
