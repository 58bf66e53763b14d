// The twin of a filter step: the same arithmetic in Eigen's fixed sizes. Reads a count of steps per line, answers with
// the nanoseconds they took and where the pose went.

#include <Eigen/Dense>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdint>

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix3x2d = Eigen::Matrix<double, 3, 2>;

struct Pose {
    double x, y, yaw;
};

struct Estimate {
    Pose pose;
    Matrix3d covariance;
};

static void sinc_and_slope(double half, double& value, double& slope) {
    const double square = half * half;
    if (square < 2.5e-3) {
        value = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0));
        slope = -half / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0));
        return;
    }
    const double sin = std::sin(half), cos = std::cos(half);
    value = sin / half;
    slope = (cos - sin / half) / half;
}

static void predict(Estimate& estimate, double distance, double turn, const Matrix2d& noise) {
    double sinc, slope;
    sinc_and_slope(0.5 * turn, sinc, slope);
    const double middle = estimate.pose.yaw + 0.5 * turn;
    const double sin = std::sin(middle), cos = std::cos(middle);
    const double chord = distance * sinc, change = 0.5 * distance * slope;
    Matrix3d by_pose;
    by_pose << 1.0, 0.0, -chord * sin, 0.0, 1.0, chord * cos, 0.0, 0.0, 1.0;
    Matrix3x2d by_piece;
    by_piece << sinc * cos, change * cos - 0.5 * chord * sin, sinc * sin, change * sin + 0.5 * chord * cos, 0.0, 1.0;
    estimate.pose = {estimate.pose.x + chord * cos, estimate.pose.y + chord * sin, estimate.pose.yaw + turn};
    const Matrix3d sum =
        by_pose * estimate.covariance * by_pose.transpose() + by_piece * noise * by_piece.transpose();
    estimate.covariance = 0.5 * (sum + sum.transpose());
}

static bool update(Estimate& estimate, const Vector3d& innovation, const Matrix3d& noise, double gate) {
    const Matrix3d spread = estimate.covariance + noise;
    const Matrix3d inverse = spread.inverse();
    const double ratio = innovation.dot(inverse * innovation);
    if (ratio > gate) return false;
    const Matrix3d gain = estimate.covariance * inverse;
    const Vector3d change = gain * innovation;
    estimate.pose = {estimate.pose.x + change.x(), estimate.pose.y + change.y(), estimate.pose.yaw + change.z()};
    const Matrix3d rest = Matrix3d::Identity() - gain;
    const Matrix3d sum = rest * estimate.covariance * rest.transpose() + gain * noise * gain.transpose();
    estimate.covariance = 0.5 * (sum + sum.transpose());
    return true;
}

int main() {
    long steps;
    while (std::scanf("%ld", &steps) == 1) {
        Estimate estimate{{0.0, 0.0, 0.0}, 1e-6 * Matrix3d::Identity()};
        Matrix2d piece_noise;
        piece_noise << 5e-10, 0.0, 0.0, 2e-8;
        const Matrix3d noise = Vector3d(1e-8, 1e-8, 4e-7).asDiagonal();
        std::uint32_t random = 1;
        long taken = 0;
        const auto begin = std::chrono::steady_clock::now();
        for (long step = 0; step < steps; ++step) {
            // Numerical Recipes' quick generator: both twins see the same motions and innovations.
            random = random * 1664525u + 1013904223u;
            const double share = random / 4294967296.0 - 0.5;
            predict(estimate, 1e-3 * (1.0 + share), 4e-3 * share, piece_noise);
            const Vector3d innovation(2e-5 * share, -1e-5 * share, 1e-4 * share);
            taken += update(estimate, innovation, noise, 11.345);
        }
        const auto nanos = std::chrono::steady_clock::now() - begin;
        std::printf("%lld %ld %.17g %.17g %.17g\n",
                    static_cast<long long>(std::chrono::duration_cast<std::chrono::nanoseconds>(nanos).count()), taken,
                    estimate.pose.x, estimate.pose.y, estimate.covariance.trace());
        std::fflush(stdout);
    }
}
