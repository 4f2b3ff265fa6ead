/* Included before each file by static analysis (`./run check-analysis`) and by nothing else: which
 * code comes back from our own functions, which an analyser does not look into. */
#pragma once

#include <errno.h>

#include "base/diag.h"
#include "io/decode.h"

#define diag_set(diag, code, ...)                                                                  \
    __extension__({                                                                                \
        int model_code = (code);                                                                   \
        (diag_set)(diag, model_code, __VA_ARGS__);                                                 \
        model_code;                                                                                \
    })

#define reject(...)                                                                                \
    __extension__({                                                                                \
        (reject)(__VA_ARGS__);                                                                     \
        -EBADMSG;                                                                                  \
    })
