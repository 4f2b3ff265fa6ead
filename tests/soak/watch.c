#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "io/modbus_client.h"
#include "tests/soak/soak.h"

#define PERIOD_NS  NSEC_PER_SEC
#define TIMEOUT_MS 3000
#define LINE_BYTES 1200
#define DELAY_MS                                                                                   \
    (1000.0 / SOAK_RATE_HZ) /* of waiting for a core in a second: the machine is loaded */
#define BUSY_MOST  0.97     /* of the machine's cores in a second, likewise */
#define UPTIME_OFF 3.0      /* seconds; it is stopped for up to 2 */
#define PLACE_OFF  0.007    /* degrees, of latitude: within the circle */

static unsigned entries_of(pid_t pid, const char *folder)
{
    char path[64];
    unsigned count = 0;
    snprintf(path, sizeof(path), "/proc/%d/%s", pid, folder);
    DIR *directory = opendir(path);
    while (directory && readdir(directory))
        count++;
    if (directory)
        closedir(directory);
    return count > 2 ? count - 2 : 0;
}

static double resident_mib(pid_t pid)
{
    char path[64];
    unsigned long pages = 0;
    snprintf(path, sizeof(path), "/proc/%d/statm", pid);
    FILE *file = fopen(path, "re");
    if (file && fscanf(file, "%*u %lu", &pages) != 1)
        pages = 0;
    if (file)
        fclose(file);
    return (double)pages * (double)sysconf(_SC_PAGESIZE) / 1048576.0;
}

/* How long the threads that there are have waited for a core, all together. */
static double delay_ms(pid_t pid)
{
    char path[320];
    double sum_ms = 0.0;
    snprintf(path, sizeof(path), "/proc/%d/task", pid);
    DIR *directory = opendir(path);
    for (struct dirent *entry; directory && (entry = readdir(directory));) {
        unsigned long long waited_ns = 0;
        snprintf(path, sizeof(path), "/proc/%d/task/%s/schedstat", pid, entry->d_name);
        FILE *file = entry->d_name[0] == '.' ? NULL : fopen(path, "re");
        if (file && fscanf(file, "%*u %llu", &waited_ns) == 1)
            sum_ms += (double)waited_ns * 1e-6;
        if (file)
            fclose(file);
    }
    if (directory)
        closedir(directory);
    return sum_ms;
}

/* Of all cores since the last call: the part in which they did something, or were taken away. */
static double busy_part(double last[2])
{
    double t[8] = {0}, all = 0.0;
    FILE *file = fopen("/proc/stat", "re");
    if (file && fscanf(file, "cpu %lf %lf %lf %lf %lf %lf %lf %lf", &t[0], &t[1], &t[2], &t[3],
                       &t[4], &t[5], &t[6], &t[7]) != 8)
        t[0] = 0.0;
    if (file)
        fclose(file);
    for (int i = 0; i < 8; i++)
        all += t[i];
    double idle = t[3] + t[4], gone = all - last[0];
    double busy = gone > 0.0 ? 1.0 - (idle - last[1]) / gone : 0.0;
    last[0] = all;
    last[1] = idle;
    return busy;
}

static double load_now(void)
{
    double load = 0.0;
    return getloadavg(&load, 1) == 1 ? load : 0.0;
}

void watch_log(struct watch *watch)
{
    char line[LINE_BYTES];
    FILE *file = fopen(watch->log_path, "re");
    if (!file)
        return;
    fseek(file, watch->log_offset, SEEK_SET);
    while (fgets(line, sizeof(line), file) && strchr(line, '\n')) {
        const char *text = strstr(line, " fault=");
        unsigned code = text ? (unsigned)atoi(text + 7) : 0;
        if (code > 0 && code < WATCH_CODES)
            atomic_fetch_add(
                strstr(line, " is over fault=") ? &watch->cleared[code] : &watch->raised[code], 1);
        watch->log_offset = ftell(file);
    }
    fclose(file);
}

/* A counter of 32 bits may only go forward, by not more than `most`. */
static void step(struct watch *watch, const char *name, uint64_t before, uint64_t now,
                 uint32_t most, uint64_t *sum)
{
    uint32_t forward = (uint32_t)now - (uint32_t)before;
    if (forward > most) {
        fprintf(stderr, "soak: %s goes from %llu to %llu\n", name, (unsigned long long)before,
                (unsigned long long)now);
        watch->wrong_steps++;
        return;
    }
    if (now < before)
        printf("%8.1f s: %s has rolled over, from %llu to %llu\n",
               seconds_from_ns(clock_monotonic_ns() - watch->start_ns), name,
               (unsigned long long)before, (unsigned long long)now);
    *sum += forward;
}

/* What may be counted in a second, times what may have been missed of polls. */
static void check_steps(struct watch *watch, const struct health *h, double passed_s)
{
    const struct health *b = &watch->newest;
    double s = passed_s + 2.0;
    step(watch, "frames rendered", b->frames_rendered, h->frames_rendered,
         (uint32_t)(s * SOAK_RATE_HZ), &watch->frames);
    step(watch, "missed deadlines", b->missed_deadlines, h->missed_deadlines,
         (uint32_t)(s * SOAK_RATE_HZ), &watch->missed);
    step(watch, "poses accepted", b->pose_accepted, h->pose_accepted, (uint32_t)(s * 3000),
         &watch->accepted);
    step(watch, "poses rejected", b->pose_rejected, h->pose_rejected, (uint32_t)(s * 3000),
         &watch->rejected);
    step(watch, "poses lost", b->pose_lost, h->pose_lost, (uint32_t)(s * 3000), &watch->lost);
    step(watch, "CAN frames", b->can_frames, h->can_frames, (uint32_t)(s * 3000),
         &watch->can_frames);
    step(watch, "records", b->frames_recorded, h->frames_recorded, (uint32_t)(s * 9000),
         &watch->recorded);
}

static void check_now(struct watch *watch, const struct health *h)
{
    double at_s = seconds_from_ns(clock_monotonic_ns() - watch->start_ns);
    double uptime_s = seconds_from_ns(h->uptime_ns - watch->first.uptime_ns);
    static double first_s;
    int expected = atomic_load(&watch->expected);
    if (first_s == 0.0)
        first_s = at_s;
    if (fabs(uptime_s - (at_s - first_s)) > UPTIME_OFF)
        watch->wrong_uptimes++;
    if (expected && h->active_source != (unsigned)expected)
        watch->wrong_sources++;
    if (expected && h->active_source == (unsigned)expected &&
        fabs(h->position.lat_deg - SOAK_LAT_DEG(expected - 1)) > PLACE_OFF)
        watch->wrong_places++;
    if (expected && h->active_source != (unsigned)expected)
        fprintf(stderr, "soak: %.1f s: source %u drives, not %d\n", at_s, h->active_source,
                expected);
    watch->newest = *h;
    atomic_store(&watch->code, h->fault_code);
}

/* Why deadlines were missed in this second; "" where none were. */
static const char *explain(struct watch *watch, uint64_t missed, const char *event,
                           const struct watch_row *row)
{
    if (missed == 0)
        return "";
    if (strncmp(event, "stopped", 7) == 0) {
        watch->missed_by_us += missed;
        return "stopped by the soak";
    }
    if (row->delay_ms > DELAY_MS || row->busy > BUSY_MOST) {
        watch->missed_by_load += missed;
        return "the machine was loaded";
    }
    watch->missed_unexplained += missed;
    return "unexplained";
}

static void look(struct watch *watch, FILE *csv, double cpu[2], double *delay)
{
    static nsec_t last_ns;
    static const char *last_event = "";
    struct health health;
    nsec_t now_ns = clock_monotonic_ns();
    const char *event = atomic_load(&watch->event);
    double delay_now = delay_ms(watch->pid);
    struct watch_row row = {.at_s = (float)seconds_from_ns(now_ns - watch->start_ns),
                            .rss_mib = (float)resident_mib(watch->pid),
                            .delay_ms = (float)(delay_now - *delay),
                            .busy = (float)busy_part(cpu),
                            .load = (float)load_now(),
                            .fds = (uint16_t)entries_of(watch->pid, "fd"),
                            .threads = (uint16_t)entries_of(watch->pid, "task"),
                            .quiet = atomic_load(&watch->quiet)};
    *delay = delay_now;
    watch_log(watch);
    watch->polls++;
    if (modbus_client_read(watch->modbus, 1, TIMEOUT_MS, &health, NULL) < 0) {
        watch->polls_failed += row.quiet;
        return;
    }
    if (!watch->has_health)
        watch->first = watch->newest = health;
    uint64_t missed = watch->missed;
    double passed_s = last_ns ? seconds_from_ns(now_ns - last_ns) : 1.0;
    watch->has_health = true;
    last_ns = now_ns;
    check_steps(watch, &health, passed_s);
    check_now(watch, &health);
    missed = watch->missed - missed;
    row.fault = (uint16_t)health.fault_code;
    row.source = (uint8_t)health.active_source;
    const char *what = strncmp(last_event, "stopped", 7) == 0 ? last_event : event;
    fprintf(csv, "%.1f,%s,%s,%u,%u,%u,%u,%llu,%.1f,%u,%u,%.1f,%.2f,%.2f,%s\n", row.at_s, event,
            health_state_name(health.state), row.fault, row.source,
            (uint32_t)health.frames_rendered, (uint32_t)health.missed_deadlines,
            (unsigned long long)missed, row.rss_mib, row.fds, row.threads, row.delay_ms, row.busy,
            row.load, explain(watch, missed, what, &row));
    fflush(csv);
    last_event = event;
    if (watch->count < WATCH_ROWS_MAX)
        watch->rows[watch->count++] = row;
}

static void *watch_main(void *data)
{
    struct watch *watch = data;
    double cpu[2] = {0.0, 0.0}, delay = 0.0;
    FILE *csv = fopen(watch->csv_path, "we");
    if (!csv) {
        perror(watch->csv_path);
        exit(1);
    }
    fputs("time_s,event,state,fault,source,frames,missed,missed_now,rss_mib,descriptors,threads,"
          "waited_ms,machine_busy,load,why_missed\n",
          csv);
    nsec_t next_ns = clock_monotonic_ns();
    while (!atomic_load(&watch->stopping)) {
        look(watch, csv, cpu, &delay);
        next_ns += PERIOD_NS;
        clock_sleep_until(next_ns);
    }
    fclose(csv);
    return NULL;
}

void watch_start(struct watch *watch)
{
    watch->rows = calloc(WATCH_ROWS_MAX, sizeof(*watch->rows));
    if (!watch->rows || pthread_create(&watch->thread, NULL, watch_main, watch) != 0) {
        fputs("soak: no thread to watch with\n", stderr);
        exit(1);
    }
}

void watch_stop(struct watch *watch)
{
    atomic_store(&watch->stopping, true);
    pthread_join(watch->thread, NULL);
}
