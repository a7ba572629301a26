#include "tools/study_store.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "core/units.h"
#include "io/errors.h"
#include "io/log_reader.h"
#include "tools/cli.h"

namespace varve::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double none = std::numeric_limits<double>::quiet_NaN();

Json json_of(double value) { return std::isnan(value) ? Json() : Json(value); }
double number_of(const Json& value) { return value.is_number() ? value.get<double>() : none; }

Json json_of(const std::vector<double>& values) {
  Json array = Json::array();
  for (const double each : values) array.push_back(json_of(each));
  return array;
}
std::vector<double> numbers_of(const Json& array) {
  std::vector<double> values;
  for (const Json& each : array) values.push_back(number_of(each));
  return values;
}

std::optional<Json> read_json(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  Json object = Json::parse(file, nullptr, false);
  if (!object.is_object()) return std::nullopt;
  return object;
}

std::string point_text(const std::vector<double>& point) {
  std::string text;
  for (const double each : point) text += (text.empty() ? " at " : ",") + core::number_text(each);
  return text;
}

/// Permissions that new files do not get; mkstemp gives them to nobody but us.
mode_t current_mask() {
  const mode_t mask = umask(0);
  umask(mask);
  return mask;
}

}  // namespace

void write_whole(const std::string& path, const std::string& text) {
  std::string beside = path + ".XXXXXX";
  const auto fail = [&] {
    const std::string why = std::strerror(errno);
    std::remove(beside.c_str());
    throw ToolError(exit_output, fmt::format("{}: could not be written: {}", path, why));
  };
  const int opened = mkstemp(beside.data());
  std::FILE* file = opened < 0 ? nullptr : fdopen(opened, "wb");
  if (!file || fchmod(opened, 0666 & ~current_mask()) != 0) fail();
  const bool written = std::fwrite(text.data(), 1, text.size(), file) == text.size() &&
                       std::fflush(file) == 0 && fsync(fileno(file)) == 0;
  if ((std::fclose(file) != 0) || !written) fail();
  if (std::rename(beside.c_str(), path.c_str()) != 0) fail();
}

std::string decimal_text(double value) { return std::isnan(value) ? "" : fmt::format("{}", value); }
std::string hex_text(double value) { return std::isnan(value) ? "" : fmt::format("{:a}", value); }

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c == '\n' || c == '\r' ? ' ' : c;
  }
  return quoted + "\"";
}

std::string measure_key(const Measure& measure) {
  return fmt::format("{} every {}{}", text_of(measure.expression), measure.every,
                     point_text(measure.at_point));
}

std::string curve_key(const Curve& curve) {
  return fmt::format("{} from {} to {} points {} every {}{}", text_of(curve.expression), curve.from,
                     curve.to, curve.points, curve.every, point_text(curve.at_point));
}

std::string_view name_of(MemberState state) {
  switch (state) {
    case MemberState::missing: return "missing";
    case MemberState::partial: return "partial";
    case MemberState::unmeasured: return "unmeasured";
    case MemberState::failed: return "failed";
    case MemberState::done: return "done";
  }
  return "missing";
}

StudyStore::StudyStore(const StudyPlan& plan, std::string folder)
    : plan_(plan), folder_(std::move(folder)) {}

std::string StudyStore::path(const std::string& file) const {
  return (fs::path(folder_) / file).string();
}
std::string StudyStore::member_folder(const std::string& id) const {
  return (fs::path(folder_) / "members" / id).string();
}
std::string StudyStore::log_path(const std::string& id) const {
  return (fs::path(member_folder(id)) / "run.varve").string();
}

namespace {

/// Of all that is `listed`, what is taken in any case in which the member stands.
template <class Item, class Inner>
std::vector<Inner> taken_of(const StudyPlan& plan, const std::string& id,
                            const std::vector<Item>& listed, Inner Item::*inner,
                            std::string (*key_of)(const Inner&)) {
  std::vector<Inner> taken;
  std::set<std::string> keys;
  for (const Item& item : listed)
    for (const StudyMember& member : plan.members) {
      if (member.id != id || !item.cases.contains(plan.case_of(member).name)) continue;
      if (keys.insert(key_of(item.*inner)).second) taken.push_back(item.*inner);
      break;
    }
  return taken;
}

}  // namespace

std::vector<Measure> StudyStore::measures_of(const std::string& id) const {
  return taken_of(plan_, id, plan_.file.measures, &StudyMeasure::measure, measure_key);
}
std::vector<Curve> StudyStore::curves_of(const std::string& id) const {
  return taken_of(plan_, id, plan_.file.curves, &StudyCurve::curve, curve_key);
}

std::optional<StudyRow> StudyStore::read_row(const std::string& id) const {
  const fs::path path = fs::path(member_folder(id)) / "row.json";
  std::error_code error;
  const auto written = fs::last_write_time(path, error);
  if (error) return std::nullopt;
  // Tables are made anew whenever a member ends: what has not changed is not read again.
  const auto known = rows_.find(id);
  if (known != rows_.end() && known->second.first == written) return known->second.second;
  std::optional<StudyRow> row = parse_row(id, path.string());
  if (row) rows_[id] = {written, *row};
  return row;
}

std::optional<StudyRow> StudyStore::parse_row(const std::string& id, const std::string& path) {
  const auto object = read_json(path);
  if (!object) return std::nullopt;
  try {
    StudyRow row;
    row.id = object->at("id").get<std::string>();
    if (row.id != id) return std::nullopt;
    row.failed = object->at("status") == "failed";
    row.code = object->at("code").get<int>();
    row.error = object->at("error").get<std::string>();
    row.run_id = object->at("run_id").get<std::string>();
    row.final_chain = object->at("final_chain").get<std::string>();
    row.last_step = std::stoull(object->at("last_step").get<std::string>());
    row.time = object->at("time_s").get<double>();
    row.stop = object->at("stop").get<std::string>();
    for (const auto& [key, value] : object->at("values").items())
      row.values[key] = number_of(value);
    for (const auto& [key, curve] : object->at("curves").items())
      row.curves[key] = {numbers_of(curve.at("time_s")), numbers_of(curve.at("value"))};
    return row;
  } catch (const std::exception&) {
    return std::nullopt;  // a file of another making: the member is run again
  }
}

void StudyStore::write_row(const StudyRow& row) const {
  Json object{{"schema", "varve.study_row/1"},
              {"id", row.id},
              {"status", row.failed ? "failed" : "ok"},
              {"code", row.code},
              {"error", row.error},
              {"run_id", row.run_id},
              {"final_chain", row.final_chain},
              {"last_step", std::to_string(row.last_step)},
              {"time_s", row.time},
              {"stop", row.stop},
              {"values", Json::object()},
              {"curves", Json::object()}};
  for (const auto& [key, value] : row.values) object["values"][key] = json_of(value);
  for (const auto& [key, curve] : row.curves)
    object["curves"][key] = {{"time_s", json_of(curve.time)}, {"value", json_of(curve.value)}};
  write_whole((fs::path(member_folder(row.id)) / "row.json").string(),
              object.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

StudyTiming StudyStore::read_timing(const std::string& id) const {
  StudyTiming timing;
  const auto object = read_json((fs::path(member_folder(id)) / "timing.json").string());
  if (!object) return timing;
  timing.run_s = object->value("run_s", 0.0);
  timing.measure_s = object->value("measure_s", 0.0);
  timing.steps = object->value("steps", std::uint64_t{0});
  timing.log_bytes = object->value("log_bytes", std::uint64_t{0});
  return timing;
}

void StudyStore::write_timing(const std::string& id, const StudyTiming& timing) const {
  const Json object{{"run_s", timing.run_s},
                    {"measure_s", timing.measure_s},
                    {"steps", timing.steps},
                    {"log_bytes", timing.log_bytes}};
  write_whole((fs::path(member_folder(id)) / "timing.json").string(), object.dump(1) + "\n");
}

bool StudyStore::has_log(const StudyMember& member, const StudyRow& row) const {
  try {
    const auto log = io::LogReader::open(log_path(member.id));
    const auto last = log->header(log->last_step());
    return log->completeness() == io::Completeness::complete && log->closed() && last &&
           last->chain.hex() == row.final_chain && log->genesis().run_id() == row.run_id &&
           (member.is_fork || log->genesis().scenario == member.text);
  } catch (const io::LogError&) {
    return false;
  }
}

MemberState StudyStore::state_of(const StudyMember& member) const {
  const auto row = read_row(member.id);
  const bool any_log = fs::exists(log_path(member.id));
  if (!row) return any_log ? MemberState::partial : MemberState::missing;
  if (row->failed) return MemberState::failed;
  bool measured = true;
  for (const Measure& each : measures_of(member.id))
    measured = measured && row->values.count(measure_key(each)) > 0;
  for (const Curve& each : curves_of(member.id))
    measured = measured && row->curves.count(curve_key(each)) > 0;
  const bool must_have_log = member.keep == Keep::log || !measured;
  if (must_have_log && !has_log(member, *row))
    return any_log ? MemberState::partial : MemberState::missing;
  if (member.keep == Keep::digests && !any_log &&
      !fs::exists(fs::path(member_folder(member.id)) / "run.digest"))
    return MemberState::missing;
  return measured ? MemberState::done : MemberState::unmeasured;
}

void StudyStore::forget(const std::string& id) const {
  std::error_code ignored;
  fs::remove_all(member_folder(id), ignored);
}

void StudyStore::tidy() const {
  std::set<std::string> awaited;
  for (const StudyMember& member : plan_.members) {
    if (!member.parent) continue;
    const std::string& parent = plan_.members[*member.parent].id;
    if (awaited.count(parent) > 0 || !fs::exists(log_path(parent))) continue;
    const MemberState state = state_of(member);
    if (state != MemberState::done && state != MemberState::failed) awaited.insert(parent);
  }
  for (const StudyMember& member : plan_.members) {
    if (member.keep == Keep::log || awaited.count(member.id) > 0) continue;
    if (!fs::exists(log_path(member.id))) continue;
    const auto row = read_row(member.id);
    std::error_code ignored;
    if (row && (row->failed || state_of(member) == MemberState::done))
      fs::remove(log_path(member.id), ignored);
  }
}

void StudyStore::write_plan() const {
  std::string text = "id,case,seed,origin";
  for (const std::string& key : plan_.keys) text += "," + csv_cell(key);
  text += ",keep,quick\n";
  for (const StudyMember& member : plan_.members) {
    text += fmt::format("{},{},{},{}", member.id, plan_.case_of(member).name, member.seed,
                        csv_cell(origin_of(plan_, member)));
    for (const std::string& key : plan_.keys) {
      const std::string* value = member.value_of(key);
      text += "," + (value ? csv_cell(*value) : "");
    }
    text += fmt::format(",{},{}\n", name_of(member.keep), member.quick ? "yes" : "no");
  }
  write_whole(path("plan.csv"), text);
}

void StudyStore::write_results() const {
  std::string results = "id,case,seed,status,error,last_step,time_s,stop";
  for (const std::string& key : plan_.keys) results += "," + csv_cell(key);
  for (const StudyMeasure& each : plan_.file.measures)
    results += fmt::format(",{0},{0}_hex", each.measure.name);
  results += "\n";
  std::string timings = "id,case,seed,run_s,measure_s,steps,log_bytes\n";
  for (const StudyMember& member : plan_.members) {
    const auto row = read_row(member.id);
    if (!row) continue;
    const std::string& name = plan_.case_of(member).name;
    results += fmt::format("{},{},{},{},{},{},{},{}", member.id, name, member.seed,
                           row->failed ? "failed" : "ok", csv_cell(row->error), row->last_step,
                           decimal_text(row->time), row->stop);
    for (const std::string& key : plan_.keys) {
      const std::string* value = member.value_of(key);
      results += "," + (value ? csv_cell(*value) : "");
    }
    for (const StudyMeasure& each : plan_.file.measures) {
      const auto found = row->values.find(measure_key(each.measure));
      const bool taken = each.cases.contains(name) && found != row->values.end();
      const double value = taken ? found->second : none;
      results += fmt::format(",{},{}", decimal_text(value), hex_text(value));
    }
    results += "\n";
    const StudyTiming timing = read_timing(member.id);
    timings += fmt::format("{},{},{},{:.3f},{:.3f},{},{}\n", member.id, name, member.seed,
                           timing.run_s, timing.measure_s, timing.steps, timing.log_bytes);
  }
  write_whole(path("results.csv"), results);
  write_whole(path("timings.csv"), timings);
}

}  // namespace varve::tools
