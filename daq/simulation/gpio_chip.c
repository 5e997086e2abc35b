/* A GPIO chip that exists inside this process only. libgpiod stays the real one: its calls of open, ioctl
 * and the like are redirected by rewriting the slots of its own procedure linkage table, so that nothing
 * else in the process is touched and no environment variable has to be set before the start.
 * The kernel interface imitated here is <linux/gpio.h>, version 2; one line per request. */
#define _GNU_SOURCE
#include <elf.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <link.h>
#include <linux/gpio.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <time.h>
#include <unistd.h>

enum { LINES = 8, CHIPS = 16, FLOATING = -1 };
static const char CHIP[] = "/dev/gpiochip-simulated";
static const char SUBSYSTEM[] = "/sys/dev/char/254:99/subsystem";

/* One end of a socket pair is the descriptor of the request, edges are written into the other. */
static struct line {
    int wire; /* 0, 1 or FLOATING: then the bias decides */
    int request, edges;
    uint64_t flags;
    uint32_t sequence;
    char consumer[GPIO_MAX_NAME_SIZE];
} lines[LINES];
static int chips[CHIPS];
static pthread_mutex_t state = PTHREAD_MUTEX_INITIALIZER;

static int fail(int cause)
{
    errno = cause;
    return -1;
}

static int level(const struct line *line)
{
    int high = line->wire == FLOATING ? (line->flags & GPIO_V2_LINE_FLAG_BIAS_PULL_UP) != 0 : line->wire;
    return high ^ ((line->flags & GPIO_V2_LINE_FLAG_ACTIVE_LOW) != 0);
}

static int is_chip(int fd)
{
    for (int i = 0; i < CHIPS; i++)
        if (fd > 0 && chips[i] == fd)
            return 1;
    return 0;
}

static struct line *requested_by(int fd)
{
    for (int i = 0; i < LINES; i++)
        if (fd > 0 && lines[i].request == fd)
            return &lines[i];
    return NULL;
}

static int chip_info(struct gpiochip_info *info)
{
    *info = (struct gpiochip_info){.name = "gpiochip-simulated", .label = "tomoshadow", .lines = LINES};
    return 0;
}

static int line_info(struct gpio_v2_line_info *info)
{
    uint32_t offset = info->offset;
    if (offset >= LINES)
        return fail(EINVAL);
    *info = (struct gpio_v2_line_info){.offset = offset, .flags = lines[offset].flags};
    if (lines[offset].request) {
        info->flags |= GPIO_V2_LINE_FLAG_USED;
        memcpy(info->consumer, lines[offset].consumer, sizeof info->consumer);
    }
    return 0;
}

static int request_line(struct gpio_v2_line_request *request)
{
    int ends[2];
    struct line *line = &lines[request->offsets[0] % LINES];
    if (request->num_lines != 1 || request->offsets[0] >= LINES)
        return fail(EINVAL);
    if (line->request)
        return fail(EBUSY);
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends))
        return -1;
    line->flags = request->config.flags;
    for (uint32_t i = 0; i < request->config.num_attrs; i++)
        if (request->config.attrs[i].attr.id == GPIO_V2_LINE_ATTR_ID_FLAGS)
            line->flags = request->config.attrs[i].attr.flags;
    line->request = request->fd = ends[0];
    line->edges = ends[1];
    line->sequence = 0;
    memcpy(line->consumer, request->consumer, sizeof line->consumer);
    return 0;
}

static int chip_ioctl(unsigned request, void *argument)
{
    switch (request) {
    case GPIO_GET_CHIPINFO_IOCTL: return chip_info(argument);
    case GPIO_V2_GET_LINEINFO_IOCTL: return line_info(argument);
    case GPIO_V2_GET_LINE_IOCTL: return request_line(argument);
    default: return fail(EINVAL);
    }
}

static int line_ioctl(const struct line *line, unsigned request, struct gpio_v2_line_values *values)
{
    if (request != GPIO_V2_LINE_GET_VALUES_IOCTL)
        return fail(EINVAL);
    values->bits = values->mask & (__u64)level(line);
    return 0;
}

static int simulated_ioctl(int fd, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    pthread_mutex_lock(&state);
    const struct line *line = requested_by(fd);
    int ours = line || is_chip(fd);
    int result = line ? line_ioctl(line, (unsigned)request, argument)
                      : ours ? chip_ioctl((unsigned)request, argument) : 0;
    pthread_mutex_unlock(&state);
    return ours ? result : ioctl(fd, request, argument);
}

static int simulated_open(const char *path, int flags, ...)
{
    if (strcmp(path, CHIP))
        return open(path, flags); /* libgpiod opens chips and never creates files: no mode */
    int fd = open("/dev/null", flags);
    pthread_mutex_lock(&state);
    for (int i = 0; fd >= 0 && i < CHIPS; i++)
        if (!chips[i]) {
            chips[i] = fd;
            break;
        }
    pthread_mutex_unlock(&state);
    return fd;
}

static int simulated_close(int fd)
{
    pthread_mutex_lock(&state);
    struct line *line = requested_by(fd);
    if (line) {
        close(line->edges);
        line->request = line->edges = 0;
        line->flags = 0;
    }
    for (int i = 0; i < CHIPS; i++)
        if (chips[i] == fd)
            chips[i] = 0;
    pthread_mutex_unlock(&state);
    return close(fd);
}

static int simulated_lstat(const char *path, struct stat *status)
{
    if (strcmp(path, CHIP))
        return lstat(path, status);
    *status = (struct stat){.st_mode = S_IFCHR | 0600, .st_rdev = makedev(254, 99)};
    return 0;
}

static int simulated_stat(const char *path, struct stat *status)
{
    return strcmp(path, CHIP) ? stat(path, status) : simulated_lstat(path, status);
}

/* Names of lstat and stat in wheels built against a C library before 2.33. */
static int simulated_lxstat(int version, const char *path, struct stat *status)
{
    (void)version;
    return simulated_lstat(path, status);
}

static int simulated_xstat(int version, const char *path, struct stat *status)
{
    (void)version;
    return simulated_stat(path, status);
}

static char *simulated_realpath(const char *path, char *resolved)
{
    if (strcmp(path, SUBSYSTEM))
        return realpath(path, resolved);
    return resolved ? strcpy(resolved, "/sys/bus/gpio") : strdup("/sys/bus/gpio");
}

static const struct {
    const char *name;
    void *replacement;
} redirections[] = {
    {"open", simulated_open},       {"close", simulated_close},      {"ioctl", simulated_ioctl},
    {"lstat", simulated_lstat},     {"stat", simulated_stat},        {"__lxstat", simulated_lxstat},
    {"__xstat", simulated_xstat},   {"realpath", simulated_realpath},
};

static int redirect(void **slot, const char *name)
{
    for (size_t i = 0; i < sizeof redirections / sizeof *redirections; i++)
        if (!strcmp(name, redirections[i].name)) {
            uintptr_t page = (uintptr_t)slot & ~((uintptr_t)sysconf(_SC_PAGESIZE) - 1);
            if (mprotect((void *)page, (size_t)sysconf(_SC_PAGESIZE), PROT_READ | PROT_WRITE))
                return 0;
            *slot = redirections[i].replacement;
            return 1;
        }
    return 0;
}

static int redirect_object(struct dl_phdr_info *object, size_t size, void *library)
{
    (void)size;
    if (strcmp(object->dlpi_name, library))
        return 0;
    const ElfW(Dyn) *entry = NULL;
    for (int i = 0; i < object->dlpi_phnum; i++)
        if (object->dlpi_phdr[i].p_type == PT_DYNAMIC)
            entry = (const void *)(object->dlpi_addr + object->dlpi_phdr[i].p_vaddr);
    uintptr_t table[DT_JMPREL + 1] = {0};
    for (; entry && entry->d_tag != DT_NULL; entry++)
        if (entry->d_tag > 0 && entry->d_tag <= DT_JMPREL)
            table[entry->d_tag] = entry->d_un.d_ptr;
    if (table[DT_PLTREL] != DT_RELA)
        return 0;
    const ElfW(Sym) *symbols = (const void *)table[DT_SYMTAB];
    const ElfW(Rela) *relocation = (const void *)table[DT_JMPREL], *end = relocation + table[DT_PLTRELSZ] / sizeof *end;
    int redirected = 0;
    for (; relocation < end; relocation++) {
        const char *name = (const char *)table[DT_STRTAB] + symbols[ELF64_R_SYM(relocation->r_info)].st_name;
        redirected += redirect((void **)(object->dlpi_addr + relocation->r_offset), name);
    }
    return redirected;
}

/* Redirect the calls of one loaded library; returns how many of its slots were rewritten. */
int gpio_chip_redirect(const char *library)
{
    return dl_iterate_phdr(redirect_object, (void *)library);
}

/* Lowest line that nobody has requested; -1 where all are taken. */
int gpio_chip_free_line(void)
{
    pthread_mutex_lock(&state);
    int free_line = -1;
    for (int i = LINES - 1; i >= 0; i--)
        if (!lines[i].request)
            free_line = i;
    pthread_mutex_unlock(&state);
    return free_line;
}

/* Drive the wire of one line: 0, 1, or -1 for a broken wire. Readers that asked for this edge get it. */
int gpio_chip_drive(unsigned offset, int wire)
{
    if (offset >= LINES || wire < FLOATING || wire > 1)
        return fail(EINVAL);
    pthread_mutex_lock(&state);
    struct line *line = &lines[offset];
    int before = level(line);
    line->wire = wire;
    int after = level(line);
    uint64_t wanted = after ? GPIO_V2_LINE_FLAG_EDGE_RISING : GPIO_V2_LINE_FLAG_EDGE_FALLING;
    if (before != after && line->request && line->flags & wanted) {
        struct timespec now;
        clock_gettime(CLOCK_MONOTONIC, &now);
        struct gpio_v2_line_event event = {
            .timestamp_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec,
            .id = after ? GPIO_V2_LINE_EVENT_RISING_EDGE : GPIO_V2_LINE_EVENT_FALLING_EDGE,
            .offset = offset,
            .seqno = ++line->sequence,
            .line_seqno = line->sequence,
        };
        /* A full buffer drops edges, as the kernel does. */
        (void)!send(line->edges, &event, sizeof event, MSG_DONTWAIT | MSG_NOSIGNAL);
    }
    pthread_mutex_unlock(&state);
    return 0;
}
