#include "daemon/recorder.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define FLUSH_NS (50 * NSEC_PER_MSEC)
#define RETRY_NS NSEC_PER_SEC /* after a failure */

struct recorder {
    struct otwlog_writer *writer;
    atomic_bool stopping;
    pthread_mutex_t lock; /* of these two */
    bool failed;
    struct diag diag;
    bool has_thread;
    pthread_t thread;
};

static bool flush(struct recorder *recorder)
{
    struct diag diag = {0};
    bool failed = otwlog_flush(recorder->writer, &diag) < 0;
    pthread_mutex_lock(&recorder->lock);
    recorder->failed = failed;
    recorder->diag = diag;
    pthread_mutex_unlock(&recorder->lock);
    return !failed;
}

/* What comes between two tries of a disk that fails waits in the ring, as far as there is room. */
static void *recorder_main(void *data)
{
    struct recorder *recorder = data;
    nsec_t next_ns = 0;
    while (!atomic_load(&recorder->stopping)) {
        nsec_t now_ns = clock_monotonic_ns();
        if (now_ns >= next_ns)
            next_ns = flush(recorder) ? 0 : now_ns + RETRY_NS;
        clock_sleep_until(now_ns + FLUSH_NS);
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
    pthread_mutex_init(&recorder->lock, NULL);
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
    pthread_mutex_destroy(&recorder->lock);
    free(recorder);
}

struct otwlog_writer *recorder_writer(struct recorder *recorder)
{
    return recorder->writer;
}

void recorder_status(struct recorder *recorder, struct recorder_status *ret_status,
                     struct diag *ret_diag)
{
    pthread_mutex_lock(&recorder->lock);
    bool failed = recorder->failed;
    if (failed)
        *ret_diag = recorder->diag;
    pthread_mutex_unlock(&recorder->lock);
    *ret_status = (struct recorder_status){
        .failed = failed,
        .recorded = otwlog_written(recorder->writer),
        .dropped = otwlog_dropped(recorder->writer),
        .removed = otwlog_removed(recorder->writer),
    };
}
