#include "daemon/log.h"

#include <assert.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <systemd/sd-journal.h>
#include <time.h>
#include <unistd.h>

#define MESSAGE_MAX 1024
#define CHANNEL_MAX 64
#define FIELDS_MAX  5
#define FIELD_MAX   128
#define QUIET_NS    NSEC_PER_SEC
#define LIMITS      128 /* faults and sources that are limited at a time */

static struct {
    pthread_mutex_t lock;
    atomic_int level;
    char channel[CHANNEL_MAX];
    FILE *stream;
    bool journal;
    struct fault_limit {
        enum fault_code code;
        char source[CHANNEL_MAX];
        struct log_site site;
    } limits[LIMITS];
} state = {.lock = PTHREAD_MUTEX_INITIALIZER, .level = LOG_LEVEL_INFO};

/* systemd.exec(5): JOURNAL_STREAM names the device and inode that stderr was connected to. */
static bool stderr_is_journal(void)
{
    const char *text = getenv("JOURNAL_STREAM");
    unsigned long long device, inode;
    struct stat st;
    if (!text || sscanf(text, "%llu:%llu", &device, &inode) != 2 || fstat(STDERR_FILENO, &st) < 0)
        return false;
    return st.st_dev == device && st.st_ino == inode;
}

void log_init(const struct log_params *params)
{
    pthread_mutex_lock(&state.lock);
    atomic_store(&state.level, params->level ? params->level : LOG_LEVEL_INFO);
    state.stream = params->stream;
    state.journal = !params->stream && stderr_is_journal();
    snprintf(state.channel, sizeof(state.channel), "%s", params->channel ? params->channel : "");
    pthread_mutex_unlock(&state.lock);
}

bool log_shows(enum log_level level)
{
    return (int)level <= atomic_load_explicit(&state.level, memory_order_relaxed);
}

static const char *level_name(enum log_level level)
{
    static const char *const names[] = {"error",   "error",  "error", "error",
                                        "warning", "notice", "info",  "debug"};
    return names[level];
}

/* False where the journal does not take it. */
static bool write_journal(enum log_level level, const struct log_about *about, const char *message)
{
    char text[FIELDS_MAX][FIELD_MAX], line[MESSAGE_MAX + 16];
    struct iovec fields[FIELDS_MAX + 1];
    int count = 0;
    snprintf(text[count++], FIELD_MAX, "PRIORITY=%d", level);
    if (state.channel[0])
        snprintf(text[count++], FIELD_MAX, "CHANNEL=%s", state.channel);
    if (about && about->fault)
        snprintf(text[count++], FIELD_MAX, "FAULT=%u", about->fault);
    if (about && about->source)
        snprintf(text[count++], FIELD_MAX, "SOURCE=%s", about->source);
    for (int i = 0; i < count; i++)
        fields[i] = (struct iovec){text[i], strlen(text[i])};
    snprintf(line, sizeof(line), "MESSAGE=%s", message);
    fields[count++] = (struct iovec){line, strlen(line)};
    return sd_journal_sendv(fields, count) == 0;
}

static void write_line(enum log_level level, const struct log_about *about, const char *message)
{
    FILE *out = state.stream ? state.stream : stderr;
    nsec_t now_ns = clock_realtime_ns();
    time_t seconds = (time_t)(now_ns / NSEC_PER_SEC);
    struct tm tm;
    localtime_r(&seconds, &tm);
    flockfile(out);
    if (state.journal) /* sd-daemon(3): the level as a prefix */
        fprintf(out, "<%d>%s", level, message);
    else
        fprintf(out, "%02d:%02d:%02d.%03d %s %s", tm.tm_hour, tm.tm_min, tm.tm_sec,
                (int)(now_ns / NSEC_PER_MSEC % 1000), level_name(level), message);
    if (about && about->fault)
        fprintf(out, " fault=%u", about->fault);
    if (about && about->source)
        fprintf(out, " source=%s", about->source);
    if (state.channel[0] && !state.journal)
        fprintf(out, " channel=%s", state.channel);
    fputc('\n', out);
    funlockfile(out);
    fflush(out);
}

/* A message is one line: what a peer sent may be in it, and shall not forge a second one. */
static void make_printable(char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f)
            *text = ' ';
}

static void __attribute__((format(printf, 4, 0)))
write_locked(struct log_site *site, enum log_level level, const struct log_about *about,
             const char *format, va_list args)
{
    char message[MESSAGE_MAX];
    nsec_t now_ns = clock_monotonic_ns();
    if (site && now_ns < site->opens_ns) {
        site->suppressed++;
        return;
    }
    int used = vsnprintf(message, sizeof(message), format, args);
    if (site && site->suppressed && used >= 0 && (size_t)used < sizeof(message))
        snprintf(message + used, sizeof(message) - (size_t)used, " (and %u more like it)",
                 site->suppressed);
    if (site)
        *site = (struct log_site){.opens_ns = now_ns + QUIET_NS};
    make_printable(message);
    if (!state.journal || !write_journal(level, about, message))
        write_line(level, about, message);
}

void log_write(struct log_site *site, enum log_level level, const struct log_about *about,
               const char *format, ...)
{
    if (!log_shows(level))
        return;
    va_list args;
    va_start(args, format);
    pthread_mutex_lock(&state.lock);
    write_locked(site, level, about, format, args);
    pthread_mutex_unlock(&state.lock);
    va_end(args);
}

/* The limit of a fault of a source. A new one takes the place that has been quiet for longest. */
static struct log_site *limit_of(enum fault_code code, const char *source)
{
    struct fault_limit *place = &state.limits[0];
    for (size_t i = 0; i < LIMITS; i++) {
        struct fault_limit *limit = &state.limits[i];
        if (limit->code == code && strcmp(limit->source, source) == 0)
            return &limit->site;
        if (limit->site.opens_ns < place->site.opens_ns)
            place = limit;
    }
    *place = (struct fault_limit){.code = code};
    snprintf(place->source, sizeof(place->source), "%s", source);
    return &place->site;
}

void log_fault(enum fault_code code, const char *source, const char *format, ...)
{
    static const enum log_level levels[] = {LOG_LEVEL_NOTICE, LOG_LEVEL_WARNING, LOG_LEVEL_ERROR};
    const struct fault_info *info = fault_find(code);
    assert(info);
    if (!log_shows(levels[info->severity]))
        return;
    const struct log_about about = {.fault = code, .source = source};
    va_list args;
    va_start(args, format);
    pthread_mutex_lock(&state.lock);
    write_locked(limit_of(code, source ? source : ""), levels[info->severity], &about, format,
                 args);
    pthread_mutex_unlock(&state.lock);
    va_end(args);
}

void log_fault_cleared(enum fault_code code, const char *source)
{
    const struct fault_info *info = fault_find(code);
    const struct log_about about = {.fault = code, .source = source};
    assert(info);
    log_write(NULL, LOG_LEVEL_NOTICE, &about, "%s is over", info->name);
}
