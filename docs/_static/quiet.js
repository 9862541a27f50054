// The theme tells the console each step it takes; here the console is for what goes wrong.
const log = console.log;
console.log = (...words) => String(words[0]).startsWith("[PST]") || log(...words);
