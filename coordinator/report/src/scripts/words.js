// Numbers, nouns with their number, and names as text.

// A number with a comma between thousands: `12,345`.
function grouped(number) {
  return number.toLocaleString("en");
}

// Turns a message that begins in lower case into a sentence.
function sentence(message) {
  return `${message.charAt(0).toUpperCase()}${message.slice(1)}.`;
}

// A number with its noun, which is given in the singular: `1 behaviour`, `2,000 behaviours`.
function counted(count, noun) {
  return `${grouped(count)} ${noun}${count === 1 ? "" : "s"}`;
}

// The name of a class as pages show it: with spaces instead of the `_` of files and commands.
function shown(name) {
  return name.split("_").filter(Boolean).join(" ") || name;
}
