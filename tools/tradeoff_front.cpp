// Errors of rungs, and which of them nothing beats. Plain numbers in, plain numbers out.
#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/tradeoff.h"

namespace varve::tools {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

/// Mean over seeds, component by component; empty where a seed lacks it.
std::vector<double> mean_of(const RungResult& rung, const std::string& name) {
  std::vector<double> sum;
  for (const RungRun& run : rung.runs) {
    const auto found = run.values.find(name);
    if (found == run.values.end() || found->second.empty()) return {};
    if (sum.empty()) sum.assign(found->second.size(), 0.0);
    if (sum.size() != found->second.size()) return {};
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += found->second[k];
  }
  for (double& each : sum) each /= static_cast<double>(rung.runs.size());
  return sum;
}

/// Standard deviation over seeds, root mean square over components.
double deviation_of(const RungResult& rung, const std::string& name,
                    const std::vector<double>& mean) {
  if (rung.runs.size() < 2 || mean.empty()) return 0;
  double sum = 0;
  for (const RungRun& run : rung.runs) {
    const std::vector<double>& values = run.values.at(name);
    for (std::size_t k = 0; k < mean.size(); ++k) {
      const double off = values[k] - mean[k];
      sum += off * off;
    }
  }
  return std::sqrt(sum / static_cast<double>((rung.runs.size() - 1) * mean.size()));
}

double largest_of(const std::vector<double>& values) {
  double largest = 0;
  for (const double each : values) largest = std::max(largest, std::abs(each));
  return largest;
}

Judged judged_of(const TradeMeasure& measure, const RungResult& rung,
                 const std::vector<double>& reference) {
  Judged out;
  const std::vector<double> mean = mean_of(rung, measure.name);
  if (mean.empty()) return out;
  out.value = mean.size() == 1 ? mean.front() : largest_of(mean);
  double scale = measure.known ? measure.scale : largest_of(reference);
  std::vector<double> target = reference;
  if (measure.known) target.assign(mean.size(), *measure.known);
  if (target.size() != mean.size()) return out;
  double sum = 0;
  for (std::size_t k = 0; k < mean.size(); ++k)
    sum += (mean[k] - target[k]) * (mean[k] - target[k]);
  const double off = mean.size() == 1 ? mean.front() - target.front()
                                      : std::sqrt(sum / static_cast<double>(mean.size()));
  // A reference of exactly nothing is met exactly or not at all.
  if (scale == 0) {
    if (off == 0) out.error = 0;
    return out;
  }
  out.error = off / scale;
  out.spread = deviation_of(rung, measure.name, mean) / scale;
  return out;
}

Cost mean_cost(const std::vector<RungRun>& runs) {
  Cost cost;
  double steps = 0, bytes = 0;
  const auto n = static_cast<double>(runs.size());
  for (const RungRun& run : runs) {
    cost.cpu_s += run.cost.cpu_s / n;
    cost.wall_s += run.cost.wall_s / n;
    steps += static_cast<double>(run.cost.steps) / n;
    bytes += static_cast<double>(run.cost.bytes) / n;
  }
  cost.steps = static_cast<std::uint64_t>(std::llround(steps));
  cost.bytes = static_cast<std::uint64_t>(std::llround(bytes));
  return cost;
}

}  // namespace

std::vector<bool> pareto_front(std::span<const double> cost, std::span<const double> error) {
  std::vector<bool> front(cost.size());
  for (std::size_t i = 0; i < cost.size(); ++i) {
    bool beaten = std::isnan(cost[i]) || std::isnan(error[i]);
    for (std::size_t j = 0; j < cost.size() && !beaten; ++j)
      beaten = cost[j] <= cost[i] && error[j] <= error[i] &&
               (cost[j] < cost[i] || error[j] < error[i]);
    front[i] = !beaten;
  }
  return front;
}

std::optional<std::size_t> cheapest_within(std::span<const double> cost,
                                           std::span<const double> error, double limit) {
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < cost.size(); ++i) {
    if (std::isnan(cost[i]) || !(error[i] <= limit)) continue;
    if (!best || cost[i] < cost[*best] || (cost[i] == cost[*best] && error[i] < error[*best]))
      best = i;
  }
  return best;
}

void share_values(std::vector<RungResult>& rungs) {
  const RungResult& standard = rungs.front();
  for (RungResult& rung : rungs) {
    if (rung.rung.knob != "record" || rung.runs.size() != standard.runs.size()) continue;
    for (std::size_t k = 0; k < rung.runs.size(); ++k)
      if (!rung.runs[k].chain.empty() && rung.runs[k].chain == standard.runs[k].chain)
        rung.runs[k].values = standard.runs[k].values;
  }
}

std::vector<std::string> judge(std::vector<TradeMeasure>& measures, std::vector<RungResult>& rungs,
                               std::size_t reference) {
  std::vector<std::string> missing;
  std::erase_if(measures, [&](const TradeMeasure& measure) {
    if (!mean_of(rungs[reference], measure.name).empty()) return false;
    missing.push_back(measure.name);
    return true;
  });
  std::vector<double> costs, errors;
  for (std::size_t i = 0; i < rungs.size(); ++i) {
    RungResult& rung = rungs[i];
    rung.reference = i == reference;
    rung.judged.clear();
    rung.worst.reset();
    if (rung.status == "ran") {
      rung.cost = mean_cost(rung.runs);
      bool whole = !measures.empty();
      double worst = 0;
      for (const TradeMeasure& measure : measures) {
        rung.judged.push_back(
            judged_of(measure, rung, mean_of(rungs[reference], measure.name)));
        const std::optional<double>& error = rung.judged.back().error;
        // What few seeds leave open counts against a rung.
        const double open =
            rung.judged.back().spread / std::sqrt(static_cast<double>(rung.runs.size()));
        if (error) worst = std::max(worst, std::abs(*error) + (i == reference ? 0 : open));
        whole = whole && error && !std::isnan(*error);
      }
      if (whole) rung.worst = worst;
    }
    costs.push_back(rung.worst ? rung.cost.cpu_s : none);
    errors.push_back(rung.worst.value_or(none));
  }
  const std::vector<bool> front = pareto_front(costs, errors);
  for (std::size_t i = 0; i < rungs.size(); ++i) rungs[i].front = front[i];
  return missing;
}

}  // namespace varve::tools
