// Arithmetic as users write it in study files: what can be said of one run (measures) and of many
// (claims). This part knows the grammar and numbers only; what a name stands for is the caller's.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace varve::tools {

/// A text that is no expression, or one that names what is not there. `column` from 1, in bytes of
/// the expression.
class ExpressionError : public std::runtime_error {
 public:
  ExpressionError(std::size_t column, const std::string& text)
      : std::runtime_error(text), column_(column) {}
  std::size_t column() const noexcept { return column_; }

 private:
  std::size_t column_;
};

struct Filter {
  std::string key, value;
  bool operator==(const Filter&) const = default;
};

struct Expression {
  enum class Kind {
    number,
    reference,  ///< NAME or NAME[WORD, KEY=VALUE, ...]
    call,       ///< NAME(ARGUMENTS)
    operation,  ///< "+ - * / < <= > >= == != and or" with two arguments, "not", "neg" with one
  };
  Kind kind = Kind::number;
  double number = 0;             ///< SI
  std::string name;
  std::string word;              ///< first of the brackets where it is no KEY=VALUE
  std::vector<Filter> filters;
  std::vector<Expression> arguments;
  std::size_t column = 1;
};

/// Throws ExpressionError.
Expression parse_expression(std::string_view text);

/// Value of a node that is not arithmetic, or nothing: it is then evaluated as arithmetic.
using NodeValue = std::function<std::optional<double>(const Expression&)>;

/// Value in double; NaN stands for "has none", and so is whatever is computed from it. `value_of`
/// is asked first at every reference and call. Functions known here: abs, sqrt, power, least,
/// greatest, exists, default. Throws ExpressionError for a name that nobody knows.
double evaluate(const Expression& expression, const NodeValue& value_of);

/// Names of those functions with the least and the greatest number of arguments.
struct FunctionRule {
  std::string_view name;
  std::size_t arguments_min, arguments_max;
};
std::span<const FunctionRule> arithmetic_functions();

/// Calls `visit` for every node, parents first.
void for_each_node(const Expression& expression,
                   const std::function<void(const Expression&)>& visit);

/// "mean", "contacts.first_s": the expression as one would write it, in one fixed spelling.
std::string text_of(const Expression& expression);

}  // namespace varve::tools
