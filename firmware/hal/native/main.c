/* The device on a machine with POSIX: behind a TCP port or a pseudo-terminal, without an actuator.
 *
 *     tactstrip-native (--tcp PORT | --pty) [--truth FILE] [--rate HZ]
 *                     [--adc gain=G[,delay_us=US[,noise=MV]]] [--switch-stdin [--unsensed]]
 *
 * Listens as `tactstrip emulate` does: the first line says the port under which it is reached, and
 * options mean the same. For sanitizers, fuzzing and the tests of hosts. */
#define _XOPEN_SOURCE 700

#include "../../emulate/emulated.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define TICK_MS 2
#define IDLE_TICK_MS 20
#define LEAST_RATE_HZ 1
#define MOST_RATE_HZ 50000 /* the emulator's slew lets the full swing pass within one sample */
#define MOST_GAIN 100.0
#define MOST_DELAY_US 1000.0
#define MOST_NOISE_MV 100000.0
#define CHUNK 4096U

struct line {
    bool is_pty;
    int server; /* -1 where there is none */
    int host;   /* -1 while there is none */
};

static volatile sig_atomic_t asked_to_end;
static struct emulated emulated;
static FILE *truth;
static int words = -1; /* where the amplifier's switch is told, if anywhere */

static void ask_to_end(int number) {
    (void)number;
    asked_to_end = 1;
}

static void fail(const char *what) {
    (void)fprintf(stderr, "tactstrip-native: %s: %s\n", what, strerror(errno));
    exit(3);
}

static uint64_t clock_us(void) {
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000U + (uint64_t)now.tv_nsec / 1000U;
}

void truth_put(const char *text, size_t size) {
    if (fwrite(text, 1, size, truth) != size) {
        fail("truth");
    }
}

void complain(const char *text, size_t size) { (void)fwrite(text, 1, size, stderr); }

static void hear_words(uint64_t now_us) {
    char some[CHUNK];
    struct pollfd watched = {.fd = words, .events = POLLIN};
    if (poll(&watched, 1, 0) <= 0) {
        return;
    }
    const ssize_t size = read(words, some, sizeof(some));
    for (ssize_t i = 0; i < size; i++) {
        emulated_hear(&emulated, now_us, some[i]);
    }
    if (size == 0) { /* nobody tells anything any more */
        words = -1;
    }
}

static uint64_t random_boot_id(void) {
    uint64_t boot_id = 0;
    FILE *source = fopen("/dev/urandom", "rb");
    if (source == NULL || fread(&boot_id, sizeof(boot_id), 1, source) != 1U) {
        fail("/dev/urandom");
    }
    (void)fclose(source);
    return boot_id >> 1;
}

static struct line listen_tcp(uint16_t port) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
    socklen_t size = sizeof(address);
    const int on = 1;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int server = socket(AF_INET, SOCK_STREAM, 0);
    if (server < 0 || setsockopt(server, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0 ||
        bind(server, (const struct sockaddr *)&address, size) != 0 || listen(server, 8) != 0 ||
        getsockname(server, (struct sockaddr *)&address, &size) != 0) {
        fail("tcp");
    }
    (void)printf("socket://127.0.0.1:%d\n", (int)ntohs(address.sin_port));
    return (struct line){.is_pty = false, .server = server, .host = -1};
}

static struct line open_pty(void) {
    struct termios raw;
    const int ours = posix_openpt(O_RDWR | O_NOCTTY);
    if (ours < 0 || grantpt(ours) != 0 || unlockpt(ours) != 0) {
        fail("pty");
    }
    const char *name = ptsname(ours);
    const int theirs = open(name, O_RDWR | O_NOCTTY);
    if (theirs < 0 || tcgetattr(theirs, &raw) != 0) {
        fail("pty");
    }
    raw.c_iflag = 0;
    raw.c_oflag = 0;
    raw.c_lflag = 0;
    raw.c_cflag |= (tcflag_t)CS8;
    if (tcsetattr(theirs, TCSANOW, &raw) != 0 || fcntl(ours, F_SETFL, O_NONBLOCK) != 0) {
        fail("pty");
    }
    (void)printf("%s\n", name);
    (void)close(theirs);
    return (struct line){.is_pty = true, .server = -1, .host = ours};
}

/* One host at a time; a second one is shown the door. */
static void let_in(struct line *line) {
    const int on = 1;
    const int newcomer = accept(line->server, NULL, NULL);
    if (newcomer < 0) {
        return;
    }
    if (line->host >= 0) {
        (void)close(newcomer);
        return;
    }
    (void)fcntl(newcomer, F_SETFL, O_NONBLOCK);
    (void)setsockopt(newcomer, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    line->host = newcomer;
}

/* Return how many bytes arrived within the time; -1 where no host is there. */
static ssize_t read_line(struct line *line, uint8_t bytes[CHUNK], int timeout_ms) {
    struct pollfd watched[2] = {{.fd = line->host, .events = POLLIN},
                                {.fd = line->server, .events = POLLIN}};
    if (poll(watched, 2, timeout_ms) < 0) {
        return line->host >= 0 ? 0 : -1;
    }
    if (watched[0].revents == 0) { /* a host that has left goes before the next one comes */
        if ((watched[1].revents & POLLIN) != 0) {
            let_in(line);
        }
        return line->host >= 0 ? 0 : -1;
    }
    const ssize_t size = read(line->host, bytes, CHUNK);
    if (size > 0) {
        return size;
    }
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) {
        return 0;
    }
    if (line->is_pty) { /* stays ours; it reports at once, for as long as no host has it open */
        (void)poll(NULL, 0, timeout_ms);
    } else {
        (void)close(line->host);
        line->host = -1;
    }
    return -1;
}

/* Never wait for a host that does not read: what does not fit is lost, as on a wire. */
static void write_line(const struct line *line, const uint8_t *bytes, size_t size) {
    if (line->host >= 0 && write(line->host, bytes, size) < 0) {
        return;
    }
}

/* What came, at most a frame in each turn: however much comes, what is measured goes on. */
static void serve(struct line *line, uint64_t began_us) {
    uint8_t bytes[CHUNK];
    ssize_t size = 0;
    ssize_t taken = 0;
    bool connected = false;
    while (asked_to_end == 0) {
        if (taken >= size) {
            const struct device *device = &emulated.endpoint.device;
            const int tick_ms = device_is_on(device) ? TICK_MS : IDLE_TICK_MS;
            size = read_line(line, bytes, device->is_measuring ? 0 : tick_ms);
            taken = 0;
        }
        const uint64_t now_us = clock_us() - began_us;
        hear_words(now_us);
        emulated_advance(&emulated, now_us);
        emulated_measure(&emulated);
        if (size < 0 && connected) {
            emulated_hang_up(&emulated, now_us, "line");
        }
        connected = size >= 0;
        size_t told = 0;
        for (uint32_t i = 0; i < LONGEST_FRAME && told == 0U && taken < size; i++) {
            uint8_t answer[LONGEST_ANSWER];
            told = emulated_receive(&emulated, now_us, bytes[taken], answer);
            taken++;
            if (told > 0U) {
                (void)fflush(truth);
                write_line(line, answer, told);
            }
        }
        (void)fflush(truth);
    }
    emulated_hang_up(&emulated, clock_us() - began_us, "end");
    (void)fflush(truth);
}

static long number(const char *option, const char *text, long least, long most) {
    char *end = NULL;
    errno = 0;
    const long value = strtol(text, &end, 10);
    if (errno != 0 || end == text || *end != '\0' || value < least || value > most) {
        (void)fprintf(stderr, "tactstrip-native: %s: %ld to %ld, got \"%s\"\n", option,
                      least, most, text);
        exit(2);
    }
    return value;
}

/* Take `name=`, and digits with at most one point up to the next comma or the end. */
static bool take_number(const char **text, const char *name, double *value) {
    const size_t size = strlen(name);
    if (strncmp(*text, name, size) != 0) {
        return false;
    }
    const char *digits = *text + size;
    const char *behind = digits + strspn(digits, "0123456789.");
    char *end = NULL;
    *value = strtod(digits, &end);
    *text = behind;
    return *digits >= '0' && *digits <= '9' && end == behind;
}

static void wire_inputs(const char *text) {
    const char *rest = text;
    double gain = 0.0;
    double delay_us = 0.0;
    double noise = 0.0;
    const bool is_form = take_number(&rest, "gain=", &gain) &&
                         (*rest == '\0' || take_number(&rest, ",delay_us=", &delay_us)) &&
                         (*rest == '\0' || take_number(&rest, ",noise=", &noise)) &&
                         *rest == '\0';
    if (!is_form || gain < 1e-6 || gain > MOST_GAIN || delay_us > MOST_DELAY_US ||
        noise > MOST_NOISE_MV) {
        (void)fprintf(stderr, "tactstrip-native: --adc: gain=G[,delay_us=US[,noise=MV]], "
                              "up to 100, 1000, 100000, got \"%s\"\n",
                      text);
        exit(2);
    }
    emulated.loop.gain_ppm = (uint32_t)(gain * 1e6 + 0.5);
    emulated.loop.delay_us = (uint32_t)delay_us;
    emulated.loop.noise_mv = (uint32_t)noise;
}

int main(int argc, char *argv[]) {
    struct about about = {.model = "native",
                          .serial_number = "1",
                          .firmware = "tactstrip firmware 2.0 native",
                          .sample_rate_mhz = 48000000U,
                          .entropy = ENTROPY_SYSTEM,
                          .emulated = true};
    long port = -1;
    bool on_pty = false;
    bool unsensed = false;
    for (int i = 1; i < argc; i++) {
        const char *value = i + 1 < argc ? argv[i + 1] : "";
        if (strcmp(argv[i], "--pty") == 0) {
            on_pty = true;
            continue;
        }
        if (strcmp(argv[i], "--switch-stdin") == 0) {
            words = STDIN_FILENO;
            continue;
        }
        if (strcmp(argv[i], "--unsensed") == 0) {
            unsensed = true;
            continue;
        }
        if (strcmp(argv[i], "--tcp") == 0) {
            port = number(argv[i], value, 0, 65535);
        } else if (strcmp(argv[i], "--rate") == 0) {
            about.sample_rate_mhz =
                1000U * (uint32_t)number(argv[i], value, LEAST_RATE_HZ, MOST_RATE_HZ);
        } else if (strcmp(argv[i], "--adc") == 0) {
            wire_inputs(value);
        } else if (strcmp(argv[i], "--truth") == 0) {
            truth = fopen(value, "a");
            if (truth == NULL) {
                fail(value[0] != '\0' ? value : "--truth");
            }
        } else {
            port = -1;
            break;
        }
        i++;
    }
    if (on_pty == (port >= 0)) {
        (void)fprintf(stderr, "usage: tactstrip-native (--tcp PORT | --pty) [--truth FILE] "
                              "[--rate HZ] [--adc gain=G[,delay_us=US[,noise=MV]]] "
                              "[--switch-stdin [--unsensed]]\n");
        return 2;
    }
    (void)signal(SIGINT, ask_to_end);
    (void)signal(SIGTERM, ask_to_end);
    (void)signal(SIGPIPE, SIG_IGN);
    about.boot_id = random_boot_id();
    if (truth == NULL) {
        truth = fopen("/dev/null", "w");
    }
    emulated.senses = words >= 0 && !unsensed;
    const uint64_t began_us = clock_us();
    emulated_init(&emulated, &about, began_us);
    struct line line = on_pty ? open_pty() : listen_tcp((uint16_t)port);
    (void)fflush(stdout);
    serve(&line, began_us);
    return 0;
}
