/* The floor under every periodic loop: wake at absolute deadlines and note how late.
   usage: deadline PERIOD_NS COUNT PRIORITY SPIN_NS   (PRIORITY 0: ordinary scheduling) */
#define _GNU_SOURCE
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

static long long now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static int ascending(const void *a, const void *b) {
    long long x = *(const long long *)a, y = *(const long long *)b;
    return (x > y) - (x < y);
}

int main(int argc, char **argv) {
    if (argc != 5)
        return 2;
    long long period = atoll(argv[1]), spin = atoll(argv[4]);
    long count = atol(argv[2]);
    int granted = 1;
    prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
    if (atoi(argv[3]) > 0) {
        struct sched_param p = {.sched_priority = atoi(argv[3])};
        granted = sched_setscheduler(0, SCHED_FIFO, &p) == 0 && mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    }
    long long *late = malloc(count * sizeof *late), missed = 0, deadline = now() + period;
    for (long i = 0; i < count; i++) {
        long long wake = deadline - spin;
        struct timespec t = {wake / 1000000000LL, wake % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
        long long n;
        while ((n = now()) < deadline)
            ;
        late[i] = n - deadline;
        missed += late[i] / period;
        deadline += (late[i] / period + 1) * period;
    }
    qsort(late, count, sizeof *late, ascending);
    printf("{\"granted\": %d, \"missed\": %lld, \"lateness_s\": [%.9f, %.9f, %.9f, %.9f]}\n", granted, missed,
           late[count / 2] * 1e-9, late[count * 99 / 100] * 1e-9, late[count * 999 / 1000] * 1e-9,
           late[count - 1] * 1e-9);
    return 0;
}
