#include "tools/expression.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "core/math.h"
#include "core/units.h"
#include "tools/cli.h"

namespace varve::tools {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t depth_max = 64;
constexpr std::size_t unlimited = std::numeric_limits<std::size_t>::max();

constexpr std::array<FunctionRule, 7> arithmetic = {{{"abs", 1, 1},
                                                     {"sqrt", 1, 1},
                                                     {"power", 2, 2},
                                                     {"least", 1, unlimited},
                                                     {"greatest", 1, unlimited},
                                                     {"exists", 1, 1},
                                                     {"default", 2, 2}}};

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_blank(char c) { return c == ' ' || c == '\t'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

Expression operation(std::string name, std::size_t column, std::vector<Expression> arguments) {
  Expression node;
  node.kind = Expression::Kind::operation;
  node.name = std::move(name);
  node.arguments = std::move(arguments);
  node.column = column;
  return node;
}

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  Expression run() {
    Expression whole = disjunction();
    skip();
    if (at_ < text_.size()) fail(fmt::format("expected an operator, got '{}'", rest()));
    return whole;
  }

 private:
  [[noreturn]] void fail(const std::string& what) { throw ExpressionError(at_ + 1, what); }
  void skip() {
    while (at_ < text_.size() && is_blank(text_[at_])) ++at_;
  }
  std::string rest() const {
    constexpr std::size_t shown = 20;
    const std::string_view left = text_.substr(at_);
    return std::string(left.substr(0, shown)) + (left.size() > shown ? "..." : "");
  }
  bool take(std::string_view symbol) {
    skip();
    if (!text_.substr(at_).starts_with(symbol)) return false;
    at_ += symbol.size();
    return true;
  }
  void expect(char symbol) {
    if (!take(std::string_view(&symbol, 1)))
      fail(at_ < text_.size() ? fmt::format("expected '{}', got '{}'", symbol, rest())
                              : fmt::format("expected '{}' at the end", symbol));
  }
  bool take_word(std::string_view word) {
    skip();
    if (!text_.substr(at_).starts_with(word)) return false;
    const std::size_t end = at_ + word.size();
    if (end < text_.size() && (is_letter(text_[end]) || is_digit(text_[end]))) return false;
    at_ = end;
    return true;
  }

  Expression disjunction() {
    if (++depth_ > depth_max) fail("nested too deeply");
    Expression left = conjunction();
    for (;;) {
      skip();
      const std::size_t column = at_ + 1;
      if (!take_word("or")) break;
      left = operation("or", column, {std::move(left), conjunction()});
    }
    --depth_;
    return left;
  }
  Expression conjunction() {
    Expression left = negation();
    for (;;) {
      skip();
      const std::size_t column = at_ + 1;
      if (!take_word("and")) return left;
      left = operation("and", column, {std::move(left), negation()});
    }
  }
  Expression negation() {
    skip();
    const std::size_t column = at_ + 1;
    bool odd = false, any = false;
    while (take_word("not")) {
      odd = !odd;
      any = true;
    }
    Expression inner = comparison();
    if (!any) return inner;
    inner = operation("not", column, {std::move(inner)});
    return odd ? inner : operation("not", column, {std::move(inner)});
  }
  Expression comparison() {
    Expression left = sum();
    skip();
    const std::size_t column = at_ + 1;
    for (const char* symbol : {"<=", ">=", "==", "!=", "<", ">"})
      if (take(symbol)) return operation(symbol, column, {std::move(left), sum()});
    return left;
  }
  Expression sum() {
    Expression left = product();
    for (;;) {
      skip();
      const std::size_t column = at_ + 1;
      if (take("+"))
        left = operation("+", column, {std::move(left), product()});
      else if (take("-"))
        left = operation("-", column, {std::move(left), product()});
      else
        return left;
    }
  }
  Expression product() {
    Expression left = factor();
    for (;;) {
      skip();
      const std::size_t column = at_ + 1;
      if (take("*"))
        left = operation("*", column, {std::move(left), factor()});
      else if (take("/"))
        left = operation("/", column, {std::move(left), factor()});
      else
        return left;
    }
  }
  Expression factor() {
    skip();
    const std::size_t column = at_ + 1;
    bool negative = false;
    for (;;) {
      if (take("-"))
        negative = !negative;
      else if (!take("+"))
        break;
    }
    Expression inner = primary();
    return negative ? operation("neg", column, {std::move(inner)}) : inner;
  }

  Expression primary() {
    skip();
    if (at_ >= text_.size()) fail("expected a number, a name or '(' at the end");
    const char c = text_[at_];
    if (take("(")) {
      Expression inner = disjunction();
      expect(')');
      return inner;
    }
    if (is_digit(c) || c == '.') return number();
    if (is_letter(c)) return name();
    fail(fmt::format("expected a number, a name or '(', got '{}'", rest()));
  }

  /// Digits, and after them the longest word that is a unit.
  Expression number() {
    Expression node;
    node.column = at_ + 1;
    const char* begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), node.number);
    if (error != std::errc{}) fail(fmt::format("'{}' is not a number", rest()));
    const std::size_t digits = static_cast<std::size_t>(end - begin);
    std::size_t unit = at_ + digits;
    while (unit < text_.size() && is_blank(text_[unit])) ++unit;
    std::size_t stop = unit;
    if (stop < text_.size() && (is_letter(text_[stop]) || text_[stop] == '%'))
      while (stop < text_.size() && (is_letter(text_[stop]) || is_digit(text_[stop]) ||
                                     text_[stop] == '/' || text_[stop] == '.' ||
                                     text_[stop] == '%'))
        ++stop;
    const std::string_view word = text_.substr(unit, stop - unit);
    if (word == "and" || word == "or" || word.empty()) {
      at_ += digits;
      return node;
    }
    for (; stop > unit; --stop) {
      const auto read = core::read_quantity(text_.substr(at_, stop - at_));
      const auto* quantity = std::get_if<core::Quantity>(&read);
      if (!quantity) continue;
      node.number = quantity->value;
      at_ = stop;
      return node;
    }
    at_ = unit;
    fail(fmt::format("'{}' is no unit", word));
  }

  Expression name() {
    Expression node;
    node.kind = Expression::Kind::reference;
    node.column = at_ + 1;
    const std::size_t begin = at_;
    while (at_ < text_.size() &&
           (is_letter(text_[at_]) || is_digit(text_[at_]) || text_[at_] == '.'))
      ++at_;
    node.name = text_.substr(begin, at_ - begin);
    if (take("[")) {
      brackets(node);
    } else if (take("(")) {
      node.kind = Expression::Kind::call;
      if (take(")")) return node;
      do node.arguments.push_back(disjunction());
      while (take(","));
      expect(')');
    }
    return node;
  }

  void brackets(Expression& node) {
    const std::size_t end = text_.find(']', at_);
    if (end == std::string_view::npos) fail("expected ']' at the end");
    bool first = true;
    while (at_ <= end) {
      const std::size_t comma = std::min(text_.find(',', at_), end);
      const std::string_view item = trimmed(text_.substr(at_, comma - at_));
      const std::size_t equals = item.find('=');
      if (equals == std::string_view::npos && first && !item.empty()) {
        node.word = item;
      } else {
        const std::string_view key = trimmed(item.substr(0, equals));
        if (equals == std::string_view::npos || key.empty())
          fail(fmt::format("expected KEY=VALUE, got '{}'", item));
        node.filters.push_back(
            {std::string(key), std::string(trimmed(item.substr(equals + 1)))});
      }
      first = false;
      at_ = comma + 1;
    }
  }

  std::string_view text_;
  std::size_t at_ = 0, depth_ = 0;
};

double operate(const std::string& name, double a, double b) {
  if (std::isnan(a) || std::isnan(b)) return none;
  if (name == "+") return a + b;
  if (name == "-") return a - b;
  if (name == "*") return a * b;
  if (name == "/") return b == 0 ? none : a / b;
  if (name == "<") return a < b;
  if (name == "<=") return a <= b;
  if (name == ">") return a > b;
  if (name == ">=") return a >= b;
  if (name == "==") return a == b;
  if (name == "!=") return a != b;
  if (name == "and") return a != 0 && b != 0;
  return a != 0 || b != 0;
}

double call(const Expression& node, const NodeValue& value_of) {
  std::vector<double> values;
  for (const Expression& argument : node.arguments) values.push_back(evaluate(argument, value_of));
  const auto rule = std::find_if(arithmetic.begin(), arithmetic.end(),
                                 [&](const FunctionRule& each) { return each.name == node.name; });
  if (rule == arithmetic.end())
    throw ExpressionError(node.column, fmt::format("unknown function '{}'", node.name));
  if (values.size() < rule->arguments_min || values.size() > rule->arguments_max)
    throw ExpressionError(node.column, fmt::format("{}: wrong number of arguments", node.name));
  if (node.name == "exists") return std::isnan(values[0]) ? 0 : 1;
  if (node.name == "default") return std::isnan(values[0]) ? values[1] : values[0];
  for (const double each : values)
    if (std::isnan(each)) return none;
  if (node.name == "abs") return std::abs(values[0]);
  if (node.name == "sqrt") return values[0] < 0 ? none : std::sqrt(values[0]);
  if (node.name == "power") return core::pow(values[0], values[1]);
  if (node.name == "least") return *std::min_element(values.begin(), values.end());
  return *std::max_element(values.begin(), values.end());
}

}  // namespace

Expression parse_expression(std::string_view text) { return Parser(text).run(); }

double evaluate(const Expression& node, const NodeValue& value_of) {
  switch (node.kind) {
    case Expression::Kind::number: return node.number;
    case Expression::Kind::reference:
      if (const auto value = value_of(node)) return *value;
      throw ExpressionError(node.column, fmt::format("unknown name '{}'", node.name));
    case Expression::Kind::call:
      if (const auto value = value_of(node)) return *value;
      return call(node, value_of);
    case Expression::Kind::operation: break;
  }
  const double a = evaluate(node.arguments.at(0), value_of);
  if (node.name == "neg") return -a;
  if (node.name == "not") return std::isnan(a) ? none : (a == 0 ? 1 : 0);
  return operate(node.name, a, evaluate(node.arguments.at(1), value_of));
}

std::span<const FunctionRule> arithmetic_functions() { return arithmetic; }

void for_each_node(const Expression& expression,
                   const std::function<void(const Expression&)>& visit) {
  visit(expression);
  for (const Expression& argument : expression.arguments) for_each_node(argument, visit);
}

std::string text_of(const Expression& node) {
  if (node.kind == Expression::Kind::number) return core::number_text(node.number);
  if (node.kind == Expression::Kind::operation) {
    const std::string first = text_of(node.arguments.at(0));
    if (node.name == "neg") return fmt::format("(-{})", first);
    if (node.name == "not") return fmt::format("(not {})", first);
    return fmt::format("({} {} {})", first, node.name, text_of(node.arguments.at(1)));
  }
  std::string text = node.name, inside = node.word;
  if (node.kind == Expression::Kind::call) {
    for (const Expression& argument : node.arguments)
      inside += (inside.empty() ? "" : ", ") + text_of(argument);
    return fmt::format("{}({})", text, inside);
  }
  for (const Filter& filter : node.filters)
    inside += fmt::format("{}{}={}", inside.empty() ? "" : ", ", filter.key, filter.value);
  return inside.empty() ? text : fmt::format("{}[{}]", text, inside);
}

}  // namespace varve::tools
