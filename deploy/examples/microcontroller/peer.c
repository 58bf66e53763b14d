/*
 * A vehicle on a pipe: what the test of the C end talks to. Not for a microcontroller.
 *
 *     peer BOOT COUNTER_BITS SENSORS
 *
 * SENSORS has HELLO's byte of wheels and above it that of flags. The line is standard input and
 * output, and the clock is the line: 10 us per byte received. It sends a reading after each START
 * and COMMAND and every 100 ms, with values of a generator that the test has too, some of them not
 * finite, some that its HELLO does not declare; speed and steering of the newest command come back
 * as the speed of wheel fl and as steering. At the end of input it prints its counters on standard
 * error.
 *
 * SPDX-License-Identifier: Apache-2.0 OR MIT
 */
#include "kerbside_line.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NS_PER_BYTE = 10000, READING_PERIOD_US = 100000, SILENCE_MS = 300 };

/* Knuth's MMIX linear congruential generator. */
static uint64_t state = 1;

static uint64_t next(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return state;
}

/* A number of 24 bits is exact in a float, and so is its division by a power of two. */
static float next_float(void)
{
    return ((float)(next() >> 40) - 8388608.0f) / 65536.0f;
}

static float from_bits(uint32_t bits)
{
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void sense(kb_sensors *sensors, const kb_command *command, uint64_t now_ns)
{
    const uint64_t presence = next() >> 32;
    int i;
    sensors->time_ns = now_ns;
    sensors->counts_mask = (uint8_t)(presence & 15u);
    sensors->speeds_mask = (uint8_t)((presence >> 4 & 15u) | KB_FL);
    sensors->has_steering = 1;
    sensors->has_yaw_rate = (uint8_t)(presence >> 8 & 1u);
    for (i = 0; i < 4; i++) {
        sensors->counts[i] = (int64_t)next();
        sensors->speeds[i] = next_float();
    }
    sensors->yaw_rate = presence >> 9 & 1u ? from_bits(0x7fc00000u) : next_float();
    if (presence >> 10 & 1u) {
        sensors->speeds[3] = from_bits(0xff800000u);
    }
    sensors->speeds[0] = command->speed;
    sensors->steering = command->steering;
}

static void write_frame(const uint8_t *frame, size_t length)
{
    if (fwrite(frame, 1, length, stdout) != length || fflush(stdout) != 0) {
        exit(1);
    }
}

static void say_reading(kb_vehicle *vehicle, const kb_command *command, uint64_t now_ns)
{
    uint8_t frame[KB_MAX_FRAME];
    kb_sensors sensors;
    sense(&sensors, command, now_ns);
    write_frame(frame, kb_vehicle_reading(vehicle, &sensors, frame));
}

static void say_pending(kb_vehicle *vehicle, uint64_t now_ns)
{
    uint8_t frame[KB_MAX_FRAME];
    size_t length;
    while ((length = kb_vehicle_pending(vehicle, now_ns, frame)) > 0) {
        write_frame(frame, length);
    }
}

static void drive(kb_vehicle *vehicle)
{
    kb_command command = {0, 0.0f, 0.0f};
    uint64_t now_ns = 0;
    uint64_t next_reading_ns = (uint64_t)READING_PERIOD_US * 1000u;
    int byte;
    say_pending(vehicle, now_ns);
    while ((byte = getchar()) != EOF) {
        kb_event event;
        now_ns += NS_PER_BYTE;
        event = kb_vehicle_receive(vehicle, now_ns, (uint8_t)byte, &command);
        if (event == KB_STARTED || event == KB_COMMANDED || now_ns >= next_reading_ns) {
            say_reading(vehicle, &command, now_ns);
            next_reading_ns = now_ns + (uint64_t)READING_PERIOD_US * 1000u;
        }
        say_pending(vehicle, now_ns);
    }
}

int main(int argc, char **argv)
{
    static kb_vehicle vehicle;
    static kb_hello hello;
    unsigned long declared;
    if (argc != 4) {
        fprintf(stderr, "usage: peer BOOT COUNTER_BITS SENSORS\n");
        return 2;
    }
    hello.boot = (uint32_t)strtoul(argv[1], NULL, 0);
    hello.counter_bits = (uint8_t)strtoul(argv[2], NULL, 0);
    declared = strtoul(argv[3], NULL, 0);
    hello.counts_mask = (uint8_t)(declared & 15u);
    hello.speeds_mask = (uint8_t)(declared >> 4 & 15u);
    hello.has_steering = (uint8_t)(declared >> 8 & 1u);
    hello.has_yaw_rate = (uint8_t)(declared >> 9 & 1u);
    hello.reading_period_us = READING_PERIOD_US;
    hello.silence_ms = SILENCE_MS;
    kb_vehicle_init(&vehicle, &hello);
    drive(&vehicle);
    fprintf(stderr, "line_errors %lu ignored %lu\n", (unsigned long)vehicle.line_errors,
            (unsigned long)vehicle.ignored);
    return 0;
}
