/*
 * A vehicle's main loop around the kerbside line protocol. Fill in the functions of the board and
 * link this with kerbside_line.c.
 *
 * SPDX-License-Identifier: Apache-2.0 OR MIT
 */
#include "kerbside_line.h"

/* ---- the board: yours to write ---- */

/* Time since the start [ns], never going back; a microsecond timer times 1000 does. */
uint64_t board_time_ns(void);
/* Another number at each start: a start counter kept in flash or backup memory, or a random one. */
uint32_t board_new_boot_id(void);
/* The next byte that the receive interrupt has queued; -1 if there is none. */
int board_line_read(void);
/* Queues bytes for the transmit interrupt or DMA. The queue must hold a reading and a HELLO. */
void board_line_write(const uint8_t *bytes, size_t length);
/* The encoder counter of wheel 0 to 3 (fl, fr, rl, rr), forward positive. */
int32_t board_encoder(int wheel);
/* The steering sensor's road-wheel angle [rad]; returns 0 if it has none at present. */
int board_steering(float *angle);
/* Sets the drive and steering controllers' targets [m/s], [rad]. */
void board_actuate(float speed, float steering);
/* Brings the vehicle to a stop, and keeps it there, the steering held. */
void board_stop(void);

/* ---- the vehicle ---- */

enum { READING_PERIOD_US = 5000, SILENCE_MS = 100 };

static void read_sensors(kb_sensors *sensors, uint64_t now_ns)
{
    static const kb_sensors nothing;
    int wheel;
    *sensors = nothing;
    sensors->time_ns = now_ns;
    sensors->counts_mask = KB_FL | KB_FR | KB_RL | KB_RR;
    for (wheel = 0; wheel < 4; wheel++) {
        sensors->counts[wheel] = board_encoder(wheel);
    }
    sensors->has_steering = board_steering(&sensors->steering) ? 1 : 0;
}

static void send_pending(kb_vehicle *vehicle, uint64_t now_ns)
{
    uint8_t frame[KB_MAX_FRAME];
    size_t length;
    while ((length = kb_vehicle_pending(vehicle, now_ns, frame)) > 0) {
        board_line_write(frame, length);
    }
}

static void send_reading(kb_vehicle *vehicle, uint64_t now_ns)
{
    uint8_t frame[KB_MAX_FRAME];
    kb_sensors sensors;
    read_sensors(&sensors, now_ns);
    board_line_write(frame, kb_vehicle_reading(vehicle, &sensors, frame));
}

static void obey_line(kb_vehicle *vehicle)
{
    kb_command command;
    int byte;
    while ((byte = board_line_read()) >= 0) {
        if (kb_vehicle_receive(vehicle, board_time_ns(), (uint8_t)byte, &command) == KB_COMMANDED) {
            board_actuate(command.speed, command.steering);
        }
    }
    /* On every pass, for silence has no byte; after the bytes, so that a fresh command counts. */
    if (kb_vehicle_silent(vehicle, board_time_ns())) {
        board_stop();
    }
}

int main(void)
{
    static kb_vehicle vehicle;
    static kb_hello hello;
    uint64_t next_reading_ns = board_time_ns();

    hello.boot = board_new_boot_id();
    hello.counter_bits = 32;
    hello.counts_mask = KB_FL | KB_FR | KB_RL | KB_RR;
    hello.has_steering = 1;
    hello.reading_period_us = READING_PERIOD_US;
    hello.silence_ms = SILENCE_MS;
    kb_vehicle_init(&vehicle, &hello);

    for (;;) {
        const uint64_t now_ns = board_time_ns();
        obey_line(&vehicle);
        if (now_ns >= next_reading_ns) {
            next_reading_ns += (uint64_t)READING_PERIOD_US * 1000u;
            send_reading(&vehicle, now_ns);
        }
        send_pending(&vehicle, now_ns);
    }
}
