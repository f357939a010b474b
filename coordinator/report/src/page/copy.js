// Copies a line, and confirms the copy on the line's button.
for (const button of document.querySelectorAll("button.copy")) {
  const line = button.parentElement.querySelector(".line");
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(line.textContent);
      button.textContent = "Copied";
    } catch {
      // If the browser refuses the clipboard, the line is selected instead.
      getSelection().selectAllChildren(line);
      button.textContent = "Selected";
    }
    setTimeout(() => (button.textContent = "Copy"), 1500);
  });
}
