// Numbers and what they count, in words.

// A number with a comma between thousands: `12,345`.
function grouped(number) {
  return number.toLocaleString("en");
}

// A message that begins in lower case, as a sentence.
function sentence(message) {
  return `${message.charAt(0).toUpperCase()}${message.slice(1)}.`;
}

// A number and its noun, which is given in the singular: `1 behaviour`, `2,000 behaviours`.
function counted(count, noun) {
  return `${grouped(count)} ${noun}${count === 1 ? "" : "s"}`;
}

// The name of a class as pages show it: files and commands have `_` where it has spaces.
function shown(name) {
  return name.split("_").filter(Boolean).join(" ") || name;
}
