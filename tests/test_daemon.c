#include "daemon/check_config.h"
#include "daemon/log.h"
#include "daemon/notify.h"
#include "daemon/status.h"
#include "io/modbus_server.h"
#include "tests/check.h"

#include <fcntl.h>
#include <poll.h>
#include <regex.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

static char *log_text;
static size_t log_size;
static FILE *log_stream;

static void open_log(enum log_level level, const char *channel)
{
    log_stream = open_memstream(&log_text, &log_size);
    log_init(&(struct log_params){.level = level, .channel = channel, .stream = log_stream});
}

static void close_log(void)
{
    log_init(&(struct log_params){0});
    fclose(log_stream);
    free(log_text);
    log_text = NULL;
}

static bool matches(const char *text, const char *pattern)
{
    regex_t regex;
    CHECK_INT(regcomp(&regex, pattern, REG_EXTENDED | REG_NOSUB), 0);
    bool yes = regexec(&regex, text, 0, NULL, 0) == 0;
    regfree(&regex);
    return yes;
}

static void check_matches(const char *text, const char *pattern)
{
    if (!matches(text, pattern))
        CHECK_FAIL("\"%s\" does not match %s", text, pattern);
}

static void a_line_has_time_level_message_and_fields(void)
{
    open_log(LOG_LEVEL_INFO, "left");
    log_info("ready after %d frames", 1);
    check_matches(log_text,
                  "^[0-2][0-9]:[0-5][0-9]:[0-6][0-9]\\.[0-9]{3} info ready after 1 frames "
                  "channel=left\n$");
    close_log();
    open_log(LOG_LEVEL_INFO, NULL);
    log_fault(FAULT_CAN_BUS_OFF, "bus", "can0 is bus-off");
    check_matches(log_text, " error can0 is bus-off fault=107 source=bus\n$");
    log_fault_cleared(FAULT_CAN_BUS_OFF, "bus");
    check_matches(log_text, " notice CAN_BUS_OFF is over fault=107 source=bus\n$");
    close_log();
}

static void a_level_below_the_chosen_one_is_not_shown(void)
{
    open_log(LOG_LEVEL_WARNING, NULL);
    log_info("not this");
    log_debug("nor this");
    log_warning("but this");
    check_matches(log_text, "^[^\n]* warning but this\n$");
    close_log();
}

static void a_peer_cannot_forge_a_line(void)
{
    open_log(LOG_LEVEL_INFO, NULL);
    log_info("name '%s'", "a\n00:00:00.000 error b\033[2J");
    CHECK(strchr(log_text, '\n') == log_text + log_size - 1);
    CHECK(!strchr(log_text, '\033'));
    close_log();
}

static void warn_once(void)
{
    log_warning("again");
}

static void repeated_messages_are_held_back_and_counted(void)
{
    open_log(LOG_LEVEL_INFO, NULL);
    for (int i = 0; i < 100; i++)
        warn_once();
    check_matches(log_text, "^[^\n]* warning again\n$");
    usleep(1050000);
    warn_once();
    check_matches(log_text, "\n[^\n]* warning again \\(and 99 more like it\\)\n$");
    close_log();
}

static void faults_are_limited_each_of_each_source(void)
{
    open_log(LOG_LEVEL_INFO, NULL);
    for (int i = 0; i < 10; i++) {
        log_fault(FAULT_SOURCE_LOST, "fg", "silent");
        log_fault(FAULT_POSE_REJECTED, "fg", "length %d", i);
        log_fault(FAULT_POSE_REJECTED, "host", "version %d", i);
    }
    check_matches(log_text, "^[^\n]* warning silent fault=103 source=fg\n"
                            "[^\n]* notice length 0 fault=104 source=fg\n"
                            "[^\n]* notice version 0 fault=104 source=host\n$");
    close_log();
}

/* A datagram socket that stands in for the service manager. */
static int open_manager(char path[108])
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(path, 108, "/tmp/otwd-notify-%d", (int)getpid());
    strcpy(address.sun_path, path);
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    unlink(path);
    CHECK_INT(bind(fd, (struct sockaddr *)&address, sizeof(address)), 0);
    setenv("NOTIFY_SOCKET", path, 1);
    return fd;
}

static const char *heard(int fd)
{
    static char text[512];
    ssize_t got = recv(fd, text, sizeof(text) - 1, 0);
    text[got > 0 ? got : 0] = '\0';
    return text;
}

static void the_watchdog_is_fed_by_frames_only(void)
{
    char path[108], pid[16];
    int fd = open_manager(path);
    struct notify notify;
    snprintf(pid, sizeof(pid), "%d", (int)getpid());
    setenv("WATCHDOG_USEC", "4000000", 1);
    setenv("WATCHDOG_PID", pid, 1);
    notify_init(&notify, 0);
    CHECK_INT(notify.period_ns, 2 * NSEC_PER_SEC);
    notify_beat(&notify);
    notify_tick(&notify, 1 * NSEC_PER_SEC);
    CHECK_STRING(heard(fd), ""); /* too early */
    CHECK_INT(notify_wait_ns(&notify, 1 * NSEC_PER_SEC), 1 * NSEC_PER_SEC);
    notify_tick(&notify, 2 * NSEC_PER_SEC);
    CHECK_STRING(heard(fd), "WATCHDOG=1");
    notify_tick(&notify, 5 * NSEC_PER_SEC);
    CHECK_STRING(heard(fd), ""); /* no frame came since: let systemd act */
    CHECK(notify_wait_ns(&notify, 5 * NSEC_PER_SEC) > 0);
    notify_beat(&notify);
    notify_tick(&notify, 6 * NSEC_PER_SEC);
    CHECK_STRING(heard(fd), "WATCHDOG=1");
    unsetenv("WATCHDOG_USEC");
    notify_init(&notify, 0);
    notify_beat(&notify);
    notify_tick(&notify, 100 * NSEC_PER_SEC);
    CHECK_STRING(heard(fd), "");
    CHECK_INT(notify_wait_ns(&notify, 0), INT64_MAX);
    close(fd);
    unlink(path);
    unsetenv("NOTIFY_SOCKET");
}

static void the_manager_hears_ready_status_and_stopping(void)
{
    char path[108];
    int fd = open_manager(path);
    notify_ready();
    CHECK_STRING(heard(fd), "READY=1");
    notify_status("%d Hz\nREADY=0", 60);
    CHECK_STRING(heard(fd), "STATUS=60 Hz READY=0");
    notify_extend(5000000);
    CHECK_STRING(heard(fd), "EXTEND_TIMEOUT_USEC=5000000");
    notify_stopping();
    CHECK_STRING(heard(fd), "STOPPING=1");
    close(fd);
    unlink(path);
    unsetenv("NOTIFY_SOCKET");
    notify_ready(); /* nobody listens: nothing happens */
}

/* Runs a subcommand in a child, with stdout and stderr into `out`. */
static int run(int (*run_main)(int, char **), char **argv, char *out, size_t size)
{
    int pipes[2], argc = 0, status;
    size_t used = 0;
    ssize_t got;
    while (argv[argc])
        argc++;
    CHECK_INT(pipe(pipes), 0);
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        dup2(pipes[1], 1);
        dup2(pipes[1], 2);
        close(pipes[0]);
        close(pipes[1]);
        exit(run_main(argc, argv));
    }
    close(pipes[1]);
    while (used < size - 1 && (got = read(pipes[0], out + used, size - 1 - used)) > 0)
        used += (size_t)got;
    out[used] = '\0';
    close(pipes[0]);
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

#define RUN(main, out, ...)                                                                        \
    run(main, (char *[]){"otwd " #main, __VA_ARGS__, NULL}, out, sizeof(out))

static void check_config_prints_every_error_and_exits_78(void)
{
    char out[4096], path[] = "/tmp/otwd-check-XXXXXX";
    int fd = mkstemp(path);
    CHECK_INT(dprintf(fd, "display: {width: 1}\nposee: {}\n"), 30);
    close(fd);
    CHECK_INT(RUN(check_config_main, out, path), EX_CONFIG);
    CHECK_CONTAINS(out, ":1:18: display.width is 1;");
    CHECK_CONTAINS(out, ":2:1: unknown key 'posee'; did you mean 'pose'?\n");
    CHECK_INT(RUN(check_config_main, out, "--json", path), EX_CONFIG);
    json_t *json = json_loads(out, 0, NULL);
    CHECK_INT(json_array_size(json_object_get(json, "errors")), 2);
    json_decref(json);
    CHECK_INT(RUN(check_config_main, out, "-q", path), EX_CONFIG);
    CHECK_STRING(out, "");
    CHECK_INT(truncate(path, 0), 0);
    CHECK_INT(RUN(check_config_main, out, path), 0);
    CHECK_CONTAINS(out, "nothing is wrong");
    unlink(path);
    CHECK_INT(RUN(check_config_main, out, path), EX_NOINPUT);
    CHECK_CONTAINS(out, "No such file");
    CHECK_INT(run(check_config_main, (char *[]){"otwd check-config", NULL}, out, sizeof(out)),
              EX_USAGE);
    CHECK_CONTAINS(out, "FILE is missing");
}

static pid_t serve_in_child(char address_text[ADDRESS_TEXT_MAX])
{
    struct modbus_server *server;
    struct diag diag;
    union address address;
    struct modbus_server_params params = {.listen = "127.0.0.1:0"};
    struct health health = {.state = HEALTH_RUNNING,
                            .frames_rendered = 1234,
                            .frame_rate_hz = 60,
                            .pose_age_ns = -1,
                            .height_above_terrain_m = NAN,
                            .position = {64, -22, 500.25},
                            .fault_code = FAULT_POSE_NONE};
    CHECK_INT(modbus_server_open(&params, &server, &diag), 0);
    modbus_server_publish(server, &health);
    modbus_server_address(server, &address);
    address_format(&address, address_text);
    fflush(NULL);
    pid_t child = fork();
    while (child == 0) {
        struct pollfd fd = {modbus_server_fd(server), POLLIN, 0};
        poll(&fd, 1, -1);
        modbus_server_dispatch(server, clock_monotonic_ns());
    }
    modbus_server_close(server);
    return child;
}

static void status_shows_what_a_running_daemon_publishes(void)
{
    char address[ADDRESS_TEXT_MAX], out[8192];
    pid_t child = serve_in_child(address);
    CHECK_INT(RUN(status_main, out, "--modbus", address), 0);
    CHECK_CONTAINS(out, "state               running\n");
    CHECK_CONTAINS(out, "fault               101 POSE_NONE: No source");
    CHECK_CONTAINS(out, "frames              60.00 Hz, 1234 rendered");
    CHECK_CONTAINS(out, "pose age, ms        none yet\n");
    CHECK_CONTAINS(out, "position, deg       64.0000000 -22.0000000\n");
    CHECK_INT(RUN(status_main, out, "--modbus", address, "--json"), 0);
    json_t *json = json_loads(out, 0, NULL), *pose = json_object_get(json, "pose");
    CHECK_INT(json_integer_value(json_object_get(json, "frames_rendered")), 1234);
    const char *state = json_string_value(json_object_get(json, "state"));
    CHECK_STRING(state ? state : "(none)", "running");
    CHECK(json_is_null(json_object_get(pose, "age_ms")));
    CHECK_NEAR(json_number_value(json_object_get(pose, "height_m")), 500.25, 1e-9);
    CHECK_INT(json_integer_value(json_object_get(json_object_get(json, "fault"), "code")), 101);
    json_decref(json);
    CHECK_INT(RUN(status_main, out, "--modbus", address, "--unit", "9"), EX_UNAVAILABLE);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    CHECK_INT(RUN(status_main, out, "--modbus", address), EX_UNAVAILABLE);
    CHECK_CONTAINS(out, address);
    CHECK_CONTAINS(out, "Connection refused");
}

static void status_refuses_bad_usage(void)
{
    char out[4096];
    CHECK_INT(RUN(status_main, out, "--modbus", "nonsense"), EX_USAGE);
    CHECK_INT(RUN(status_main, out, "--unit", "300"), EX_USAGE);
    CHECK_INT(RUN(status_main, out, "extra"), EX_USAGE);
    CHECK_INT(RUN(status_main, out, "--nothing"), EX_USAGE);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a line has time, level, message and fields", a_line_has_time_level_message_and_fields},
        {"a level below the chosen one is not shown", a_level_below_the_chosen_one_is_not_shown},
        {"a peer cannot forge a line", a_peer_cannot_forge_a_line},
        {"repeated messages are held back and counted",
         repeated_messages_are_held_back_and_counted},
        {"faults are limited each of each source", faults_are_limited_each_of_each_source},
        {"the watchdog is fed by frames only", the_watchdog_is_fed_by_frames_only},
        {"the manager hears ready, status and stopping",
         the_manager_hears_ready_status_and_stopping},
        {"check-config prints every error and exits 78",
         check_config_prints_every_error_and_exits_78},
        {"status shows what a running daemon publishes",
         status_shows_what_a_running_daemon_publishes},
        {"status refuses bad usage", status_refuses_bad_usage},
    };
    return CHECK_MAIN(tests);
}
