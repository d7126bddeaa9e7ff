// Shows the API's description. Swagger UI forgets a key given by "Authorize" when the tab closes.
window.SwaggerUIBundle({ url: "/openapi.json", dom_id: "#swagger-ui", deepLinking: true });
