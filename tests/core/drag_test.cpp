#include "core/drag.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace varve::core {
namespace {

constexpr double rho0 = 1000, mu = 1e-3, d = 1e-3;

/// Slip with a given Reynolds number on the superficial slip.
Slip at(double re, double porosity = 1) {
  return {re * mu / (rho0 * d) / porosity, porosity, d, rho0, mu};
}

/// Cd of a sphere from K at porosity 1: F = K u = pi/8 rho0 d^2 Cd u^2.
double sphere_cd(Drag drag, double re) {
  const Slip slip = at(re);
  return drag_coefficient<3>(make_drag_law<3>(drag), slip) * 8 / (pi * rho0 * d * d * slip.speed);
}

/// Cd of a disc: F' = 1/2 rho0 d Cd u^2.
double disc_cd(Drag drag, double re) {
  const Slip slip = at(re);
  return drag_coefficient<2>(make_drag_law<2>(drag), slip) * 2 / (rho0 * d * slip.speed);
}

/// F / (3 pi mu d u_s).
double over_stokes(Drag drag, double re, double porosity) {
  const Slip slip = at(re, porosity);
  return drag_coefficient<3>(make_drag_law<3>(drag), slip) / (3 * pi * mu * d * porosity);
}

/// Within 1e-4, and half a unit of the last printed digit.
void expect_printed(double value, double printed, int decimals, const std::string& what) {
  EXPECT_NEAR(value, printed, 1e-4 * printed + 0.5 * std::pow(10, -decimals)) << what;
}

TEST(DragOfASphere, AgreesWithTheStandardTable) {
  struct Row {
    double re, stokes, schiller_naumann, dallavalle;
  };
  const Row rows[] = {
      {0.1, 240.000, 247.401, 249.922}, {1, 24.000, 27.600, 29.485}, {5, 4.800, 6.975, 7.710},
      {10, 2.400, 4.151, 4.613},        {20, 1.200, 2.610, 2.901},   {50, 0.480, 1.538, 1.713},
      {100, 0.240, 1.092, 1.232},       {500, 0.048, 0.563, 0.714},  {1000, 0.024, 0.440, 0.611}};
  for (const Row& row : rows) {
    const std::string re = "Re " + std::to_string(row.re);
    expect_printed(sphere_cd(Drag::stokes, row.re), row.stokes, 3, re);
    expect_printed(sphere_cd(Drag::schiller_naumann, row.re), row.schiller_naumann, 3, re);
    expect_printed(sphere_cd(Drag::dallavalle_di_felice, row.re), row.dallavalle, 3, re);
  }
}

TEST(DragInASwarm, AgreesWithTheTableOfDiFeliceWenYuAndErgun) {
  struct Entry {
    double di_felice, wen_yu, ergun;
  };
  struct Row {
    double porosity;
    Entry at_re[4];  // Re 0.1, 1, 10, 50
  };
  const double re[] = {0.1, 1, 10, 50};
  const Row rows[] = {
      {1.0, {{1.0413, 1.0308, 0}, {1.2285, 1.1500, 0}, {1.9223, 1.7296, 0}, {3.5688, 3.2044, 0}}},
      {0.9,
       {{1.5332, 1.5143, 1.0408},
        {1.7743, 1.6893, 1.1488},
        {2.6722, 2.5408, 2.2291},
        {4.9279, 4.7071, 7.0302}}},
      {0.7,
       {{3.8575, 3.7895, 5.1219},
        {4.2642, 4.2276, 5.3005},
        {5.8627, 6.3583, 7.0862},
        {10.6401, 11.7797, 15.0227}}},
      {0.6,
       {{6.7936, 6.6518, 9.2863},
        {7.3015, 7.4207, 9.5293},
        {9.4929, 11.1608, 11.9599},
        {17.0602, 20.6771, 22.7623}}},
      {0.5,
       {{13.2681, 12.9405, 16.7056},
        {13.7935, 14.4363, 17.0556},
        {16.7860, 21.7124, 20.5556},
        {29.8193, 40.2255, 36.1111}}},
      {0.4,
       {{30.1028, 29.2194, 31.3108},
        {30.0463, 32.5971, 31.8576},
        {33.7229, 49.0263, 37.3264},
        {59.0618, 90.8287, 61.6319}}}};
  for (const Row& row : rows)
    for (int i = 0; i < 4; ++i) {
      const std::string what =
          "eps " + std::to_string(row.porosity) + " Re " + std::to_string(re[i]);
      const Entry& entry = row.at_re[i];
      expect_printed(over_stokes(Drag::dallavalle_di_felice, re[i], row.porosity), entry.di_felice,
                     4, what);
      expect_printed(over_stokes(Drag::schiller_naumann, re[i], row.porosity), entry.wen_yu, 4,
                     what);
      // Gidaspow is Wen-Yu in dilute, Ergun in dense suspensions.
      expect_printed(over_stokes(Drag::gidaspow, re[i], row.porosity),
                     row.porosity > 0.82 ? entry.wen_yu : entry.ergun, 4, what);
    }
}

TEST(Gidaspow, BlendsItsBranchesHalfAndHalfAtEightTenths) {
  const double wen_yu[] = {2.3276, 2.5967, 3.9054, 7.2354};
  const double ergun[] = {2.6194, 2.7561, 4.1233, 10.1997};
  const double re[] = {0.1, 1, 10, 50};
  for (int i = 0; i < 4; ++i)
    expect_printed(over_stokes(Drag::gidaspow, re[i], 0.8), 0.5 * (wen_yu[i] + ergun[i]), 4, "0.8");
}

TEST(Gidaspow, HasNoJump) {
  for (double re : {0.01, 1.0, 100.0, 500.0})
    for (double eps = 0.75; eps < 0.85; eps += 1e-4) {
      const double here = over_stokes(Drag::gidaspow, re, eps);
      EXPECT_LT(std::abs(over_stokes(Drag::gidaspow, re, eps + 1e-4) - here), 0.02 * here);
    }
}

TEST(Gidaspow, AgreesWithTabulatedBeta) {
  // beta = K (1 - eps) / V at a slip of 0.01 m/s.
  const double volume = pi * d * d * d / 6;
  const auto beta = [&](double eps) {
    const Slip slip{0.01, eps, d, rho0, mu};
    return drag_coefficient<3>(make_drag_law<3>(Drag::gidaspow), slip) * (1 - eps) / volume;
  };
  EXPECT_NEAR(beta(0.4), 1.455e5, 0.5e2);
  EXPECT_NEAR(beta(0.5), 8.375e4, 0.5e1);
  EXPECT_NEAR(beta(0.7), 2.4536e4, 0.5);
  EXPECT_NEAR(beta(0.9), 3994.8, 0.4);
  EXPECT_NEAR(beta(0.99), 318.81, 0.04);
}

TEST(Cylinder, AgreesWithComputedFlowsTo15Percent) {
  // Dennis & Chang 1970 against an engineering fit over nine decades.
  const double re[] = {5, 7, 10, 20, 40};
  const double cd[] = {4.116, 3.421, 2.846, 2.045, 1.522};
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(disc_cd(Drag::cylinder, re[i]), cd[i], 0.15 * cd[i]);
}

TEST(Cylinder, IsTheFormulaOfSuckerAndBrauer) {
  for (double re : {1e-3, 1.0, 100.0, 1e5})
    EXPECT_NEAR(disc_cd(Drag::cylinder, re),
                1.18 + 6.8 / std::pow(re, 0.89) + 1.96 / std::sqrt(re) -
                    4e-4 * re / (1 + 3.64e-7 * re * re),
                1e-10 * disc_cd(Drag::cylinder, re));
}

/// Speed at which the drag on a lone disc carries its submerged weight.
double terminal_speed_of_a_disc(Drag drag) {
  const double diameter = 2.5e-3, weight = 250 * pi / 4 * diameter * diameter * 9.81;
  const auto law = make_drag_law<2>(drag);
  double low = 0, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double u = 0.5 * (low + high);
    (drag_coefficient<2>(law, {u, 1, diameter, 1000, 0.01}) * u < weight ? low : high) = u;
  }
  return low;
}

TEST(DragOfADisc, GivesTheKnownTerminalSpeeds) {
  // d 2.5 mm, 1250 against 1000 kg/m3, mu 0.01 Pa s: Re 11 to 16.
  EXPECT_NEAR(terminal_speed_of_a_disc(Drag::dallavalle_di_felice), 0.04905, 6e-6);
  EXPECT_NEAR(terminal_speed_of_a_disc(Drag::schiller_naumann), 0.05316, 6e-6);
  EXPECT_NEAR(terminal_speed_of_a_disc(Drag::cylinder), 0.06589, 6e-6);
}

TEST(DragOfADisc, UsesTheSpheresCdOnItsOwnArea) {
  for (Drag drag : {Drag::stokes, Drag::schiller_naumann, Drag::dallavalle_di_felice})
    for (double re : {0.01, 1.0, 15.0, 2000.0})
      EXPECT_NEAR(disc_cd(drag, re), sphere_cd(drag, re), 1e-12 * sphere_cd(drag, re));
}

template <int D>
std::vector<Drag> laws_of() {
  std::vector<Drag> laws{Drag::stokes, Drag::schiller_naumann, Drag::dallavalle_di_felice,
                         Drag::gidaspow};
  if (D == 2) laws.push_back(Drag::cylinder);
  return laws;
}

template <int D>
void expect_finite_and_continuous_at_zero_slip() {
  for (Drag drag : laws_of<D>())
    for (double eps : {1.0, 0.9, 0.8, 0.5, 0.3}) {
      const auto law = make_drag_law<D>(drag);
      const double still = drag_coefficient<D>(law, {0, eps, d, rho0, mu});
      EXPECT_TRUE(std::isfinite(still));
      EXPECT_GE(still, 0);
      const double slow = drag_coefficient<D>(law, at(1e-6, eps));
      const double unit = drag_coefficient<D>(make_drag_law<D>(Drag::stokes), at(1, eps));
      // The cylinder's K falls like Re^0.11 towards zero slip.
      if (drag != Drag::cylinder) {
        EXPECT_NEAR(slow, still, 0.03 * slow);
      }
      EXPECT_GE(slow, 0.05 * unit);
    }
}

TEST(EveryDragLaw, IsFiniteAtZeroSlip) {
  expect_finite_and_continuous_at_zero_slip<2>();
  expect_finite_and_continuous_at_zero_slip<3>();
}

TEST(EveryDragLaw, GoesToStokesAtSmallReynoldsNumbers) {
  EXPECT_NEAR(sphere_cd(Drag::stokes, 1e-6) * 1e-6, 24, 1e-12);
  EXPECT_NEAR(sphere_cd(Drag::schiller_naumann, 1e-6) * 1e-6, 24, 1e-3);
  EXPECT_NEAR(sphere_cd(Drag::gidaspow, 1e-6) * 1e-6, 24, 1e-3);
  // DallaValle's own limit is 4.8^2 = 23.04.
  EXPECT_NEAR(sphere_cd(Drag::dallavalle_di_felice, 1e-6) * 1e-6, 23.04, 1e-2);
}

TEST(EveryDragLaw, StaysFiniteUpToAHundredThousand) {
  for (Drag drag : laws_of<2>())
    for (double re = 1e-6; re < 2e5; re *= 1.3)
      for (double eps : {1.0, 0.85, 0.8, 0.3}) {
        const double k = drag_coefficient<2>(make_drag_law<2>(drag), at(re, eps));
        EXPECT_TRUE(std::isfinite(k));
        EXPECT_GT(k, 0);
      }
}

TEST(EveryDragLaw, GrowsAsPorosityFalls) {
  for (Drag drag : {Drag::schiller_naumann, Drag::dallavalle_di_felice, Drag::cylinder})
    for (double re : {0.1, 15.0}) {
      double last = 0;
      for (double eps = 1.0; eps > 0.3; eps -= 0.01) {
        const double force =
            drag_coefficient<2>(make_drag_law<2>(drag), at(re, eps)) * at(re, eps).speed;
        EXPECT_GT(force, last);
        last = force;
      }
    }
}

TEST(DragOfALoneGrain, IsTheBareLawToTheBit) {
  // Porosity 1 must not pass through a power that could round.
  const Slip slip = at(14);
  const double root = 0.63 * std::sqrt(reynolds(slip)) + 4.8;
  EXPECT_EQ(drag_coefficient<2>(make_drag_law<2>(Drag::dallavalle_di_felice), slip),
            0.5 * mu * (root * root));
}

TEST(MakeDragLaw, RefusesACylinderInThreeDimensions) {
  EXPECT_THROW(make_drag_law<3>(Drag::cylinder), std::invalid_argument);
}

}  // namespace
}  // namespace varve::core
