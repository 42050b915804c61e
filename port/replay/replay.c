/* SPDX-License-Identifier: MIT */
/* replay LOG OUT: every step of a log through one estimator; all it says and what it took.
 *
 * LOG: per step u [l] and y [m] as blw_real_t and the mask of valid samples, 8 bytes.
 * OUT: once the ticks of an empty step, 4 bytes; then per step, packed, in the machine's byte
 * order:
 *   ticks (4), status (4), x_hat [n], suspicion [m], statistic, threshold, bound as blw_real_t,
 *   excluded (8), used (8), iterations (2), outcome (1), flags (1).
 * The status is that of the library, so a refused step shows.  Exit status 0: all steps replayed;
 * 1: a file; 2: usage; 3: init refused the model.
 */
#include "replay.h"
#include "counter.h"
#include "host_io.h"
#include <string.h>

enum { MAX_STATES = 255, MAX_INPUTS = 255, FIXED_BYTES = 28 };

static blw_real_t    u[MAX_INPUTS];
static blw_real_t    y[BLW_MAX_SENSORS];
static unsigned char record[FIXED_BYTES + (MAX_STATES + BLW_MAX_SENSORS + 3) * sizeof(blw_real_t)];
static size_t        record_len;

blw_status_t replay_nothing(void *self, const blw_real_t *inputs, const blw_real_t *samples,
                            blw_mask_t valid, blw_estimator_out_t *out)
{
    (void)self;
    (void)inputs;
    (void)samples;
    (void)valid;
    (void)out;
    return BLW_OK;
}

static void put(const void *from, size_t len)
{
    (void)memcpy(&record[record_len], from, len);
    record_len += len;
}

static void put_reals(const blw_real_t *from, size_t count)
{
    put(from, count * sizeof *from);
}

static void put_step(uint32_t ticks, int32_t status, const blw_estimator_out_t *out)
{
    record_len = 0U;
    put(&ticks, sizeof ticks);
    put(&status, sizeof status);
    put_reals(out->x_hat, replay_n);
    put_reals(out->suspicion, replay_m);
    put_reals(&out->statistic, 1U);
    put_reals(&out->threshold, 1U);
    put_reals(&out->bound, 1U);
    put(&out->excluded, sizeof out->excluded);
    put(&out->used, sizeof out->used);
    put(&out->iterations, sizeof out->iterations);
    put(&out->outcome, sizeof out->outcome);
    put(&out->flags, sizeof out->flags);
}

static bool next_step(int32_t log, blw_mask_t *valid)
{
    const size_t u_len = replay_l * sizeof u[0];
    const size_t y_len = replay_m * sizeof y[0];

    return (host_io_read(log, u, u_len) == u_len) && (host_io_read(log, y, y_len) == y_len)
           && (host_io_read(log, valid, sizeof *valid) == sizeof *valid);
}

static bool replay(int32_t log, int32_t results)
{
    blw_estimator_out_t out;
    blw_mask_t          valid = 0U;
    bool                written;
    int32_t             status;
    uint32_t            start;
    uint32_t            ticks;

    counter_start();
    start   = counter_read();
    status  = (int32_t)replay_pause(u, y, valid, &out); /* kept, since that of a step is, too */
    ticks   = counter_read() - start;
    written = (status == (int32_t)BLW_OK) && host_io_write(results, &ticks, sizeof ticks);
    while (written && next_step(log, &valid)) {
        start  = counter_read();
        status = (int32_t)replay_step(u, y, valid, &out);
        ticks  = counter_read() - start;
        put_step(ticks, status, &out);
        written = host_io_write(results, record, record_len);
    }
    return written;
}

int main(int argc, char **argv)
{
    int32_t log;
    int32_t results;
    bool    done;

    if (argc != 3) {
        return 2;
    }
    if (replay_init() != BLW_OK) {
        return 3;
    }
    log     = host_io_open(argv[1], HOST_IO_READ);
    results = host_io_open(argv[2], HOST_IO_WRITE);
    if ((log < 0) || (results < 0)) {
        return 1;
    }
    done = replay(log, results);
    host_io_close(results);
    host_io_close(log);
    return done ? 0 : 1;
}
