#include "daemon/recorder.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define FLUSH_NS (50 * NSEC_PER_MSEC)

struct recorder {
    struct otwlog_writer *writer;
    atomic_bool stopping, failed; /* `failed` makes `diag` visible */
    struct diag diag;
    bool has_thread;
    pthread_t thread;
};

static void *recorder_main(void *data)
{
    struct recorder *recorder = data;
    while (!atomic_load(&recorder->stopping)) {
        clock_sleep_until(clock_monotonic_ns() + FLUSH_NS);
        if (otwlog_flush(recorder->writer, &recorder->diag) < 0) {
            atomic_store(&recorder->failed, true);
            break;
        }
    }
    return NULL;
}

int recorder_open(const struct recorder_params *params, struct recorder **ret_recorder,
                  struct diag *diag)
{
    struct otwlog_params log = {.directory = params->directory, .max_mib = params->max_mib};
    if (mkdir(params->directory, 0777) < 0 && errno != EEXIST)
        return diag_set(diag, -errno, "%s: cannot make the directory: %s", params->directory,
                        strerror(errno));
    struct recorder *recorder = calloc(1, sizeof(*recorder));
    if (!recorder)
        return diag_set(diag, -ENOMEM, "%s: no memory to record", params->directory);
    int r = otwlog_create(&log, &recorder->writer, diag);
    if (r == 0) {
        r = -pthread_create(&recorder->thread, NULL, recorder_main, recorder);
        recorder->has_thread = r == 0;
        if (r < 0)
            diag_set(diag, r, "cannot start the recorder: %s", strerror(-r));
        else
            pthread_setname_np(recorder->thread, "otwd-record");
    }
    if (r < 0) {
        recorder_close(recorder);
        return r;
    }
    *ret_recorder = recorder;
    return 0;
}

void recorder_close(struct recorder *recorder)
{
    if (!recorder)
        return;
    atomic_store(&recorder->stopping, true);
    if (recorder->has_thread)
        pthread_join(recorder->thread, NULL);
    otwlog_destroy(recorder->writer);
    free(recorder);
}

struct otwlog_writer *recorder_writer(struct recorder *recorder)
{
    return recorder->writer;
}

void recorder_status(const struct recorder *recorder, struct recorder_status *ret_status,
                     struct diag *ret_diag)
{
    *ret_status = (struct recorder_status){
        .failed = atomic_load(&recorder->failed),
        .recorded = otwlog_written(recorder->writer),
        .dropped = otwlog_dropped(recorder->writer),
        .removed = otwlog_removed(recorder->writer),
    };
    if (ret_status->failed)
        *ret_diag = recorder->diag;
}
