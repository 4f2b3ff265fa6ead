/* Recording that is killed: what was written is there, and nothing but the last record is torn.
 * 3 s; OTWD_KILLS=1000 kills more. */
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "io/otwlog.h"
#include "tests/check.h"

#define KILLS_DEFAULT 150
#define MAX_MIB       1
#define FILE_BYTES    (1 << 20)
#define FLUSHES_MOST  250 /* before a program is killed */

static char folder[] = "/tmp/otwd-killed-XXXXXX";
static uint64_t seed = 11;

static uint32_t draw(uint32_t below)
{
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(seed >> 33) % below;
}

/* Record `number` is a packet of its own length, of its own bytes, at its own time. */
static size_t packet_of(int64_t number, uint8_t ret[OTWLOG_PAYLOAD_MAX])
{
    size_t size = 1 + (size_t)(number * 7919 % 2000);
    for (size_t i = 0; i < size; i++)
        ret[i] = (uint8_t)((size_t)number * 31 + i);
    return size;
}

/* Tells after each flush how many records are written. */
static void record_until_killed(int out)
{
    const struct otwlog_params params = {.directory = folder, .max_mib = MAX_MIB};
    struct otwlog_writer *writer;
    if (otwlog_create(&params, &writer, NULL) < 0)
        _exit(1);
    for (int64_t number = 0;;) {
        uint8_t data[OTWLOG_PAYLOAD_MAX];
        for (uint32_t n = draw(20); n > 0; n--, number++) {
            size_t size = packet_of(number, data);
            if (!otwlog_add_packet(writer, 0, data, size, number))
                _exit(2);
        }
        if (otwlog_flush(writer, NULL) < 0)
            _exit(3);
        int64_t told = (int64_t)otwlog_written(writer);
        if (told != number || write(out, &told, sizeof(told)) != sizeof(told))
            _exit(4);
    }
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

static int is_recording(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

struct survey {
    int64_t first, next; /* numbers of the records that are there */
    uint64_t bytes;
    unsigned files, torn;
    bool torn_before_last;
};

static void survey_file(const char *path, bool last, struct survey *survey)
{
    static uint8_t data[FILE_BYTES];
    uint8_t expected[OTWLOG_PAYLOAD_MAX];
    struct otwlog_reader reader;
    struct otwlog_record record;
    FILE *file = fopen(path, "r");
    size_t size = file ? fread(data, 1, sizeof(data), file) : 0;
    if (file)
        fclose(file);
    survey->bytes += size;
    survey->files++;
    if (last && size < OTWLOG_HEADER_SIZE) { /* killed between its making and its head */
        survey->torn++;
        return;
    }
    CHECK_INT(otwlog_reader_init(&reader, data, size, path, NULL), 0);
    while (otwlog_reader_next(&reader, &record)) {
        size_t length = packet_of(record.time_ns, expected);
        if (survey->next < 0)
            survey->first = survey->next = record.time_ns;
        CHECK_INT(record.time_ns, survey->next);
        CHECK(record.size == length && memcmp(record.payload, expected, length) == 0);
        survey->next = record.time_ns + 1;
    }
    survey->torn += reader.torn;
    survey->torn_before_last |= reader.torn && !last;
}

/* Reads all recordings in the order of their names, and removes them. */
static struct survey survey_all(void)
{
    struct survey survey = {.first = -1, .next = -1};
    struct dirent **list = NULL;
    char path[512];
    int count = scandir(folder, &list, is_recording, by_name);
    for (int i = 0; i < count; i++) {
        snprintf(path, sizeof(path), "%s/%s", folder, list[i]->d_name);
        survey_file(path, i == count - 1, &survey);
        unlink(path);
        free(list[i]);
    }
    free(list);
    return survey;
}

static int64_t kill_one(void)
{
    int pipes[2], status;
    int64_t told = 0, last;
    CHECK_INT(pipe(pipes), 0);
    draw(2);
    pid_t child = fork();
    if (child == 0)
        record_until_killed(pipes[1]);
    close(pipes[1]);
    /* After some flushes, however long they take there, and anywhere in the next ones. */
    for (uint32_t n = draw(FLUSHES_MOST); n > 0; n--)
        if (read(pipes[0], &last, sizeof(last)) == sizeof(last))
            told = last;
    usleep(draw(1000));
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    CHECK(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    while (read(pipes[0], &last, sizeof(last)) == sizeof(last))
        told = last;
    close(pipes[0]);
    return told;
}

static void killed_recordings_keep_what_was_written(void)
{
    int kills = check_kills(check_rounds(KILLS_DEFAULT, 20));
    unsigned torn = 0, rotated = 0;
    int64_t records = 0;
    CHECK(mkdtemp(folder));
    for (int i = 0; i < kills && check_failures < 10; i++) {
        int64_t told = kill_one();
        struct survey survey = survey_all();
        if (survey.next < told && told > 0)
            CHECK_FAIL("kill %d: %lld records were told of, %lld are there", i, (long long)told,
                       (long long)survey.next);
        CHECK(!survey.torn_before_last);
        CHECK(survey.bytes <= (MAX_MIB << 20));
        CHECK(survey.first <= 0 || survey.files > 1);
        torn += survey.torn;
        rotated += survey.first > 0;
        records += told;
    }
    printf("     %d programs killed, %.0f records each; %u torn tails, %u had removed files\n",
           kills, (double)records / kills, torn, rotated);
    CHECK(records > kills * 10);
    CHECK_INT(rmdir(folder), 0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"recordings that are killed keep all that was written, and stay within their limit",
         killed_recordings_keep_what_was_written},
    };
    return check_main(tests, sizeof(tests) / sizeof(tests[0]));
}
