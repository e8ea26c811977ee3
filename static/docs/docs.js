// @ts-check
/** Renders openapi.json and asyncapi.json without a library, and lets one try the calls that only read. */

/**
 * @param {string} tag
 * @param {Record<string, string>} [attributes]
 * @param {...(Node | string)} children
 * @returns {HTMLElement}
 */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/**
 * One line that tells what a schema is.
 * @param {any} schema
 * @returns {string}
 */
export function typeOf(schema) {
  if (!schema || Object.keys(schema).length === 0) return "any";
  if (schema.$ref) return String(schema.$ref).split("/").pop() ?? "?";
  if (schema.const !== undefined) return JSON.stringify(schema.const);
  if (schema.enum) return schema.enum.map((/** @type {unknown} */ one) => JSON.stringify(one)).join(" | ");
  if (schema.anyOf) return schema.anyOf.map(typeOf).join(" | ");
  if (schema.oneOf) return schema.oneOf.map(typeOf).join(" | ");
  if (schema.type === "array") return `${typeOf(schema.items)}[]`;
  if (schema.type === "object" && schema.additionalProperties && schema.additionalProperties !== true)
    return `{name: ${typeOf(schema.additionalProperties)}}`;
  return schema.format ? `${schema.type} (${schema.format})` : String(schema.type ?? "any");
}

/** @param {any} schema @returns {HTMLElement} */
function fieldTable(schema) {
  const body = make("tbody");
  const required = new Set(schema.required ?? []);
  for (const [name, one] of Object.entries(schema.properties ?? {})) {
    const field = /** @type {any} */ (one);
    body.append(
      make(
        "tr",
        {},
        make("td", {}, make("code", {}, required.has(name) ? name : `${name}?`)),
        make("td", {}, make("code", {}, typeOf(field))),
        make("td", {}, field.description ?? ""),
      ),
    );
  }
  return make("table", {}, body);
}

/** @param {string} name @param {any} schema @param {string} prefix @returns {HTMLElement} */
function schemaBox(name, schema, prefix) {
  const box = make("details", { id: `${prefix}-${name}` }, make("summary", {}, make("code", {}, name)));
  if (schema.description) box.append(make("p", { class: "text" }, schema.description));
  box.append(schema.properties ? fieldTable(schema) : make("code", {}, typeOf(schema)));
  return box;
}

/** @param {string} path @param {any} call @returns {HTMLElement} */
function tryForm(path, call) {
  /** @type {Map<string, HTMLInputElement>} */
  const inputs = new Map();
  const form = make("form");
  for (const parameter of call.parameters ?? []) {
    const input = /** @type {HTMLInputElement} */ (make("input", { name: parameter.name }));
    if (parameter.required) input.required = true;
    inputs.set(parameter.name, input);
    form.append(make("label", {}, make("span", {}, parameter.name), input));
  }
  const out = make("pre", { hidden: "" });
  form.append(make("button", {}, "try it"), out);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    let target = `..${path}`;
    const query = new URLSearchParams();
    for (const parameter of call.parameters ?? []) {
      const value = inputs.get(parameter.name)?.value ?? "";
      if (parameter.in === "path") target = target.replace(`{${parameter.name}}`, encodeURIComponent(value));
      else if (value !== "") query.append(parameter.name, value);
    }
    out.hidden = false;
    try {
      const response = await fetch(query.size ? `${target}?${query}` : target);
      const type = response.headers.get("content-type") ?? "";
      out.textContent = `${response.status} ${type}\n`;
      if (type.startsWith("image/")) {
        const image = make("img", { src: URL.createObjectURL(await response.blob()), width: "480" });
        out.append(image);
      } else {
        const text = await response.text();
        out.append(type.includes("json") ? JSON.stringify(JSON.parse(text), null, 2).slice(0, 20000) : text.slice(0, 20000));
      }
    } catch (error) {
      out.textContent = String(error);
    }
  });
  return form;
}

/** @param {string} verb @param {string} path @param {any} call @returns {HTMLElement} */
function callBox(verb, path, call) {
  const summary = make(
    "summary",
    {},
    make("span", { class: "verb" }, verb.toUpperCase()),
    make("code", {}, path),
    make("span", { class: "about" }, call.summary ?? ""),
  );
  const box = make("details", {}, summary);
  if (call.description) box.append(make("p", { class: "text" }, call.description));
  if (call.parameters?.length) {
    const rows = call.parameters.map((/** @type {any} */ one) =>
      make(
        "tr",
        {},
        make("td", {}, make("code", {}, one.name)),
        make("td", {}, one.in),
        make("td", {}, make("code", {}, typeOf(one.schema))),
        make("td", {}, one.description ?? ""),
      ),
    );
    box.append(make("h2", {}, "Parameters"), make("table", {}, make("tbody", {}, ...rows)));
  }
  for (const [type, one] of Object.entries(call.requestBody?.content ?? {}))
    box.append(make("h2", {}, "Body"), make("p", {}, `${type}: `, make("code", {}, typeOf(/** @type {any} */ (one).schema))));
  const answers = Object.entries(call.responses ?? {}).map(([status, one]) => {
    const content = Object.entries(/** @type {any} */ (one).content ?? {});
    const told = content.map(([type, body]) => `${type} ${typeOf(/** @type {any} */ (body).schema)}`).join(", ");
    return make("tr", {}, make("td", {}, status), make("td", {}, /** @type {any} */ (one).description ?? ""), make("td", {}, told));
  });
  box.append(make("h2", {}, "Answers"), make("table", {}, make("tbody", {}, ...answers)));
  if (verb === "get") box.append(make("h2", {}, "Try"), tryForm(path, call));
  return box;
}

/** @param {string} id @returns {HTMLElement} */
function place(id) {
  return /** @type {HTMLElement} */ (document.getElementById(id));
}

async function main() {
  const [open, live] = await Promise.all(
    ["../openapi.json", "../asyncapi.json"].map(async (path) => (await fetch(path)).json()),
  );
  place("about").replaceChildren(
    make("p", {}, `${open.info.title} ${open.info.version}: ${open.info.summary ?? ""}`),
    make("p", { class: "text" }, open.info.description ?? ""),
  );
  /** @type {Map<string, HTMLElement[]>} */
  const groups = new Map();
  for (const [path, calls] of Object.entries(open.paths))
    for (const [verb, call] of Object.entries(/** @type {Record<string, any>} */ (calls))) {
      const tag = call.tags?.[0] ?? "more";
      groups.set(tag, [...(groups.get(tag) ?? []), callBox(verb, path, call)]);
    }
  for (const [tag, boxes] of groups) place("calls").append(make("h2", {}, tag), ...boxes);
  place("feed").append(make("h2", {}, live.info.title), make("p", { class: "text" }, live.info.description ?? ""));
  for (const operation of Object.values(live.operations)) {
    const { action, channel, messages } = /** @type {any} */ (operation);
    const address = live.channels[channel.$ref.split("/").pop()].address;
    place("feed").append(make("p", {}, `${action === "send" ? "sent by" : "taken by"} the service on `, make("code", {}, address)));
    for (const message of messages) {
      const name = message.$ref.split("/").pop();
      place("feed").append(schemaBox(name, live.components.schemas[name], "feed"));
    }
  }
  place("schemas").append(make("h2", {}, "Schemas"));
  for (const [name, schema] of Object.entries(open.components?.schemas ?? {}))
    place("schemas").append(schemaBox(name, schema, "schema"));
}

main().catch((error) => {
  place("about").textContent = `The documents could not be read: ${error}`;
});
