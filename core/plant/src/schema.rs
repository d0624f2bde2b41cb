//! JSON Schema of the plate and the plant file, for editors that complete and check while one types.
//!
//! A schema says what a key is; checks of one key against another are the readers' alone. The two schemas are kept as
//! files, and a test holds their keys, words and limits against what the readers refuse; what is said of a plugin's
//! options comes from the plugin's own declarations.

use serde_json::{Map, Value as Json, json};

use crate::{OptionDecl, OptionType};

/// JSON Schema of the plate file.
pub const PLATE_SCHEMA: &str = include_str!("../schema/plate.json");

/// JSON Schema of the plant file, any options allowed for any plugin: [`plant_schema`] knows better.
pub const PLANT_SCHEMA: &str = include_str!("../schema/plant.json");

/// JSON Schema of the plant file in which the options of the installed plugins are those that they declare.
///
/// # Errors
/// When [`PLANT_SCHEMA`] is no JSON, which a test rules out.
pub fn plant_schema<'a>(
    plugins: impl IntoIterator<Item = (&'a str, &'a [OptionDecl])>,
) -> serde_json::Result<Json> {
    let mut schema: Json = serde_json::from_str(PLANT_SCHEMA)?;
    let rule = |(name, declared): (&str, &[OptionDecl])| {
        let mut then = json!({ "properties": { "options": options_schema(declared) } });
        if declared.iter().any(|option| option.required) {
            then["required"] = json!(["options"]);
        }
        json!({ "if": { "properties": { "plugin": { "const": name } } }, "then": then })
    };
    let rules: Vec<Json> = plugins.into_iter().map(rule).collect();
    if !rules.is_empty() {
        schema["$defs"]["options_of_plugin"]["allOf"] = Json::Array(rules);
    }
    Ok(schema)
}

/// JSON Schema of a plugin's options.
pub fn options_schema(declared: &[OptionDecl]) -> Json {
    let properties: Map<String, Json> =
        declared.iter().map(|option| (option.name.clone(), option_schema(option))).collect();
    let required: Vec<&str> = declared.iter().filter(|o| o.required).map(|o| o.name.as_str()).collect();
    let mut schema = json!({ "type": "object", "additionalProperties": false, "properties": properties });
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

fn option_schema(option: &OptionDecl) -> Json {
    let limits = |number: &str| {
        let mut schema = json!({ "type": number });
        for (key, limit) in [("minimum", option.min), ("maximum", option.max)] {
            if let Some(limit) = limit {
                schema[key] = json!(limit);
            }
        }
        schema
    };
    let with_unit = |number: Json| match option.unit.is_some() || option.kind == OptionType::Duration {
        true => json!({ "anyOf": [number, { "type": "string", "description": "A number with its unit." }] }),
        false => number,
    };
    let mut schema = match option.kind {
        OptionType::Bool => json!({ "type": "boolean" }),
        OptionType::Int => with_unit(limits("integer")),
        OptionType::Float | OptionType::Duration => with_unit(limits("number")),
        OptionType::String if option.secret => json!({ "type": ["string", "object"] }),
        OptionType::String => json!({ "type": "string" }),
        OptionType::Path => json!({ "type": "string", "minLength": 1 }),
        OptionType::Choice => json!({ "enum": option.choices }),
        OptionType::Floats => json!({ "type": "array", "items": with_unit(limits("number")) }),
    };
    schema["description"] = json!(format!("{} ({option})", option.doc.trim()));
    if option.deprecated.is_some() {
        schema["deprecated"] = json!(true);
    }
    schema
}
